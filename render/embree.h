// SPDX-License-Identifier: Apache-2.0
// The only door to Embree: handles that release themselves, errors that become exceptions, and the
// five calls whose form differs between Embree 3 and 4.
#pragma once

#include <cstddef>
#include <memory>
#include <string>
#include <type_traits>

#if LENTICULE_EMBREE_MAJOR >= 4
#include <embree4/rtcore.h>
#else
#include <embree3/rtcore.h>
#endif

namespace lenticule::render {

struct EmbreeRelease {
  void operator()(RTCDevice device) const noexcept { rtcReleaseDevice(device); }
  void operator()(RTCScene scene) const noexcept { rtcReleaseScene(scene); }
  void operator()(RTCGeometry geometry) const noexcept { rtcReleaseGeometry(geometry); }
};
template <class Handle>
using EmbreeHandle = std::unique_ptr<std::remove_pointer_t<Handle>, EmbreeRelease>;
using EmbreeScene = EmbreeHandle<RTCScene>;
using EmbreeGeometry = EmbreeHandle<RTCGeometry>;

/// A device that remembers the first error Embree reported through its callback.
class EmbreeDevice {
 public:
  /// `threads` build acceleration structures; 0 = all cores. Throws Error(Failed).
  explicit EmbreeDevice(int threads);
  ~EmbreeDevice();
  EmbreeDevice(const EmbreeDevice&) = delete;
  EmbreeDevice& operator=(const EmbreeDevice&) = delete;

  [[nodiscard]] RTCDevice get() const { return device_.get(); }

  /// Throws Error(Failed) "doing: what Embree said" if an error was reported since the last call.
  void check(const std::string& doing) const;

 private:
  struct Report;
  // Declared first: the device may report while it is being released.
  std::unique_ptr<Report> report_;
  EmbreeHandle<RTCDevice> device_;
};

/// Whether the rays of a packet leave from nearly one place in nearly one direction. Telling Embree
/// so pays for those, and costs dearly for others.
enum class Coherence { Coherent, Incoherent };

/// Embree's own check of a ray ends the process in some distributions, so nothing beyond these
/// bounds may reach it. False for NaN.
[[nodiscard]] inline bool embree_accepts(float x, float y, float z) {
  constexpr float kLimit = 1e18F;
  return x > -kLimit && x < kLimit && y > -kLimit && y < kLimit && z > -kLimit && z < kLimit;
}

/// Whether Embree takes one component of all directions of a packet for positive, or of all for
/// negative. What is nearer to zero than 1e-18 it takes for +1e-18, of either sign.
[[nodiscard]] inline bool on_one_side(const int* valid, const float* components) {
  // Nearly always their sign bits are the same, and this is asked of every packet.
  constexpr auto kClear = std::bit_cast<int32_t>(1e-17F);
  int32_t any = 0, all = -1, small = 0;
  for (size_t r = 0; r < 16; ++r) {
    const auto bits = std::bit_cast<int32_t>(components[r]);
    any |= bits & valid[r];
    all &= bits | ~valid[r];
    small |= ((bits & 0x7fffffff) < kClear ? -1 : 0) & valid[r];
  }
  if (any >= 0 || (all < 0 && small == 0)) return true;
  int negative = 0;
  for (size_t r = 0; r < 16; ++r) negative |= valid[r] & (components[r] >= 0.0F ? 0 : -1);
  return negative == 0;
}

/// Whether a packet may be traced as a coherent one. Embree then asks first what the bounds of all
/// its rays meet, which it makes from the smallest and the largest reciprocal of the directions'
/// components. Where these have both signs they bound nothing, and the whole packet can be lost
/// (`lenticule bench stability`, rows edges and inside). Such packets gain nothing there either.
[[nodiscard]] inline bool in_one_octant(const int* valid, const RTCRay16& rays) {
  return on_one_side(valid, rays.dir_x) && on_one_side(valid, rays.dir_y) &&
         on_one_side(valid, rays.dir_z);
}
[[nodiscard]] inline Coherence coherence_of(Coherence wanted, const int* valid,
                                            const RTCRay16& rays) {
  return wanted == Coherence::Coherent && in_one_octant(valid, rays) ? Coherence::Coherent
                                                                     : Coherence::Incoherent;
}

#if LENTICULE_EMBREE_MAJOR >= 4

[[nodiscard]] inline RTCRayQueryFlags query_flags(Coherence coherence) {
  return coherence == Coherence::Coherent ? RTC_RAY_QUERY_FLAG_COHERENT
                                          : RTC_RAY_QUERY_FLAG_INCOHERENT;
}
[[nodiscard]] inline RTCIntersectArguments intersect_arguments(Coherence coherence) {
  RTCIntersectArguments arguments;
  rtcInitIntersectArguments(&arguments);
  arguments.flags = query_flags(coherence);
  return arguments;
}
[[nodiscard]] inline RTCOccludedArguments occluded_arguments(Coherence coherence) {
  RTCOccludedArguments arguments;
  rtcInitOccludedArguments(&arguments);
  arguments.flags = query_flags(coherence);
  return arguments;
}
inline void intersect1(RTCScene scene, RTCRayHit& ray) {
  RTCIntersectArguments arguments = intersect_arguments(Coherence::Incoherent);
  rtcIntersect1(scene, &ray, &arguments);
}
inline void intersect16(const int* valid, RTCScene scene, RTCRayHit16& rays, Coherence coherence) {
  RTCIntersectArguments arguments = intersect_arguments(coherence_of(coherence, valid, rays.ray));
  rtcIntersect16(valid, scene, &rays, &arguments);
}
inline void occluded1(RTCScene scene, RTCRay& ray) {
  RTCOccludedArguments arguments = occluded_arguments(Coherence::Incoherent);
  rtcOccluded1(scene, &ray, &arguments);
}
inline void occluded16(const int* valid, RTCScene scene, RTCRay16& rays, Coherence coherence) {
  RTCOccludedArguments arguments = occluded_arguments(coherence_of(coherence, valid, rays));
  rtcOccluded16(valid, scene, &rays, &arguments);
}

#else

[[nodiscard]] inline RTCIntersectContext query_context(Coherence coherence) {
  RTCIntersectContext context;
  rtcInitIntersectContext(&context);
  context.flags = coherence == Coherence::Coherent ? RTC_INTERSECT_CONTEXT_FLAG_COHERENT
                                                   : RTC_INTERSECT_CONTEXT_FLAG_INCOHERENT;
  return context;
}
inline void intersect1(RTCScene scene, RTCRayHit& ray) {
  RTCIntersectContext context = query_context(Coherence::Incoherent);
  rtcIntersect1(scene, &context, &ray);
}
inline void intersect16(const int* valid, RTCScene scene, RTCRayHit16& rays, Coherence coherence) {
  RTCIntersectContext context = query_context(coherence_of(coherence, valid, rays.ray));
  rtcIntersect16(valid, scene, &context, &rays);
}
inline void occluded1(RTCScene scene, RTCRay& ray) {
  RTCIntersectContext context = query_context(Coherence::Incoherent);
  rtcOccluded1(scene, &context, &ray);
}
inline void occluded16(const int* valid, RTCScene scene, RTCRay16& rays, Coherence coherence) {
  RTCIntersectContext context = query_context(coherence_of(coherence, valid, rays));
  rtcOccluded16(valid, scene, &context, &rays);
}

#endif

}  // namespace lenticule::render
