// SPDX-License-Identifier: Apache-2.0
// The only door to Embree: handles that release themselves, errors that become exceptions, and the
// calls whose form differs between Embree 3 and 4. embree_packets.h has those for packets.
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

/// How many rays Embree traces together on this machine: 16, 8 or 4. Wider packets it takes apart,
/// ray by ray, into streams. 16 until there is a device.
[[nodiscard]] int widest_packet();

/// Whether the rays of a packet leave from nearly one place in nearly one direction. Telling Embree
/// so pays for those, and costs dearly for others.
enum class Coherence { Coherent, Incoherent };

/// Embree's own check of a ray ends the process in some distributions, so nothing beyond these
/// bounds may reach it. False for NaN.
[[nodiscard]] inline bool embree_accepts(float x, float y, float z) {
  constexpr float kLimit = 1e18F;
  return x > -kLimit && x < kLimit && y > -kLimit && y < kLimit && z > -kLimit && z < kLimit;
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
inline void occluded1(RTCScene scene, RTCRay& ray) {
  RTCOccludedArguments arguments = occluded_arguments(Coherence::Incoherent);
  rtcOccluded1(scene, &ray, &arguments);
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
inline void occluded1(RTCScene scene, RTCRay& ray) {
  RTCIntersectContext context = query_context(Coherence::Incoherent);
  rtcOccluded1(scene, &context, &ray);
}

#endif

}  // namespace lenticule::render
