// SPDX-License-Identifier: Apache-2.0
// Sole wrapper of Embree: handles that release themselves, errors as exceptions, and the calls that
// differ between Embree 3 and 4, of which no other file knows. ray_stream.h wraps the packet calls.
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <memory>
#include <string>
#include <type_traits>
#include <vector>

#if LENTICULE_EMBREE_MAJOR >= 4
#include <embree4/rtcore.h>
#else
#include <embree3/rtcore.h>
#endif

#include "optics/vec.h"

namespace lenticule::render {

struct EmbreeRelease {
  void operator()(RTCDevice device) const noexcept { rtcReleaseDevice(device); }
  void operator()(RTCScene scene) const noexcept { rtcReleaseScene(scene); }
  void operator()(RTCGeometry geometry) const noexcept { rtcReleaseGeometry(geometry); }
};
template <class Handle>
using EmbreeHandle = std::unique_ptr<std::remove_pointer_t<Handle>, EmbreeRelease>;
using EmbreeGeometry = EmbreeHandle<RTCGeometry>;

#if LENTICULE_EMBREE_MAJOR >= 4
enum class SceneFeature : unsigned {
  Triangles = RTC_FEATURE_FLAG_TRIANGLE,
  UserGeometry = RTC_FEATURE_FLAG_USER_GEOMETRY_CALLBACK_IN_GEOMETRY,
  Instances = RTC_FEATURE_FLAG_INSTANCE | RTC_FEATURE_FLAG_TRIANGLE,
};
/// Embree 4 reads from `valid` which lanes a callback of a user geometry has hit. For Embree 3,
/// `valid` is read-only.
inline constexpr bool kCallbacksReportHits = true;
#else
enum class SceneFeature : unsigned { Triangles = 1, UserGeometry = 2, Instances = 5 };
inline constexpr bool kCallbacksReportHits = false;
#endif

/// EmbreeTriangles names the arrays of a geometry of triangles, which must outlive it.
struct EmbreeTriangles {
  const Vec3f* positions = nullptr;
  const std::array<uint32_t, 3>* corners = nullptr;
};

/// HitPlane is the plane of a triangle that rays hit.
struct HitPlane {
  Vec3 corner;
  Vec3 normal;  ///< zero for a user geometry

  /// Returns the parameter at which a ray meets the plane, or else Embree's, `t`. Embree divides by
  /// an approximate reciprocal, whose last bits depend on the instruction set and on the
  /// manufacturer of the processor.
  [[nodiscard]] float distance(Vec3 origin, Vec3 direction, float t) const {
    const double exact = dot(corner - origin, normal) / dot(direction, normal);
    // False if the triangle stands for a wide one, which has no area here, or is seen edge on.
    const bool meets = exact > 0.0 && exact <= double{std::numeric_limits<float>::max()};
    return meets ? static_cast<float>(exact) : t;
  }
};

/// EmbreeScene owns a scene, and records which features of Embree its geometries need and which
/// triangles they have.
class EmbreeScene {
 public:
  void reset(RTCScene scene) { scene_.reset(scene); }
  [[nodiscard]] RTCScene get() const { return scene_.get(); }
  [[nodiscard]] unsigned features() const { return features_; }

  void attach(RTCGeometry geometry, unsigned number, SceneFeature feature,
              EmbreeTriangles triangles = {}) {
    rtcAttachGeometryByID(get(), geometry, number);
    features_ |= static_cast<unsigned>(feature);
    triangles_.resize(std::max<size_t>(triangles_.size(), number + 1));
    triangles_[number] = triangles;
    has_instances_ = has_instances_ || feature == SceneFeature::Instances;
  }
  [[nodiscard]] bool has_instances() const { return has_instances_; }

  /// Replaces the number of a geometry that was hit within an instance by the number of the
  /// instance, which is the one that the rest of the renderer knows.
  void name_instance(unsigned& geometry, unsigned instance) const {
    if (has_instances_ && instance != RTC_INVALID_GEOMETRY_ID) geometry = instance;
  }

  [[nodiscard]] HitPlane plane(unsigned geometry, unsigned primitive) const {
    const EmbreeTriangles& mesh = triangles_[geometry];
    if (mesh.positions == nullptr) return {};
    const auto& [a, b, c] = mesh.corners[primitive];
    const Vec3 corner(mesh.positions[a]);
    return {corner, cross(Vec3(mesh.positions[b]) - corner, Vec3(mesh.positions[c]) - corner)};
  }

 private:
  EmbreeHandle<RTCScene> scene_;
  unsigned features_ = 0;
  /// Indexed by the geometry's number; user geometries have no triangles.
  std::vector<EmbreeTriangles> triangles_;
  bool has_instances_ = false;
};

/// EmbreeDevice owns a device and remembers the first error that Embree reported through its
/// callback.
class EmbreeDevice {
 public:
  /// `threads` is the number of threads that build acceleration structures; 0 = all cores. Throws
  /// Error(Failed).
  explicit EmbreeDevice(int threads);
  ~EmbreeDevice();
  EmbreeDevice(const EmbreeDevice&) = delete;
  EmbreeDevice& operator=(const EmbreeDevice&) = delete;

  [[nodiscard]] RTCDevice get() const { return device_.get(); }

  /// Throws Error(Failed) "doing: Embree's message" if Embree reported an error since the last
  /// call.
  void check(const std::string& doing) const;

 private:
  struct Report;
  // Declared first, so that it is destroyed last: the device may report errors while it is
  // released.
  std::unique_ptr<Report> report_;
  EmbreeHandle<RTCDevice> device_;
};

/// Returns the widest packet that Embree traces as a unit on this machine: 16, 8 or 4. Embree
/// splits wider packets into single rays. Returns 16 before the first device is created.
[[nodiscard]] int widest_packet();

/// Coherence tells Embree if the rays of a packet start at nearly one place in nearly one
/// direction. The coherent mode is faster for such packets and much slower for others.
enum class Coherence { Coherent, Incoherent };

/// Returns true if Embree accepts these numbers. Some distributions' Embree checks rays and aborts
/// the process for numbers beyond 1.8e18. The limit is lower, since numbers may be 128 times larger
/// in the frame of an instance. Returns false for NaN.
[[nodiscard]] inline bool embree_accepts(float x, float y, float z) {
  constexpr float kLimit = 1e16F;
  return x > -kLimit && x < kLimit && y > -kLimit && y < kLimit && z > -kLimit && z < kLimit;
}

/// Returns a ray that has met nothing yet and ends at the parameter `far`, for intersect1().
[[nodiscard]] inline RTCRayHit single_ray(Vec3f origin, Vec3f direction, float far) {
  RTCRayHit ray{};
  ray.ray = {.org_x = origin.x,
             .org_y = origin.y,
             .org_z = origin.z,
             .tnear = 0.0F,
             .dir_x = direction.x,
             .dir_y = direction.y,
             .dir_z = direction.z,
             .time = 0.0F,
             .tfar = far,
             .mask = ~0U,
             .id = 0,
             .flags = 0};
  ray.hit.geomID = RTC_INVALID_GEOMETRY_ID;
  ray.hit.instID[0] = RTC_INVALID_GEOMETRY_ID;
  return ray;
}

/// Calls `function`, one of Embree's functions for a single ray or, with the mask of the active
/// lanes in `valid`, for packets.
template <class Function, class Rays, class... Valid>
void query(Function* function, const EmbreeScene& scene, Rays& rays, Coherence coherence,
           Valid... valid) {
  const bool coherent = coherence == Coherence::Coherent;
#if LENTICULE_EMBREE_MAJOR >= 4
  auto arguments = [] {
    if constexpr (requires(Rays r) { r.hit; }) {
      RTCIntersectArguments out;
      rtcInitIntersectArguments(&out);
      return out;
    } else {
      RTCOccludedArguments out;
      rtcInitOccludedArguments(&out);
      return out;
    }
  }();
  arguments.flags = coherent ? RTC_RAY_QUERY_FLAG_COHERENT : RTC_RAY_QUERY_FLAG_INCOHERENT;
  arguments.feature_mask = static_cast<RTCFeatureFlags>(scene.features());
  function(valid..., scene.get(), &rays, &arguments);
#else
  RTCIntersectContext context;
  rtcInitIntersectContext(&context);
  context.flags =
      coherent ? RTC_INTERSECT_CONTEXT_FLAG_COHERENT : RTC_INTERSECT_CONTEXT_FLAG_INCOHERENT;
  function(valid..., scene.get(), &context, &rays);
#endif
}

inline void intersect1(const EmbreeScene& scene, RTCRayHit& ray) {
  query(rtcIntersect1, scene, ray, Coherence::Incoherent);
  if (ray.hit.geomID == RTC_INVALID_GEOMETRY_ID) return;
  scene.name_instance(ray.hit.geomID, ray.hit.instID[0]);
  ray.ray.tfar = scene.plane(ray.hit.geomID, ray.hit.primID)
                     .distance({ray.ray.org_x, ray.ray.org_y, ray.ray.org_z},
                               {ray.ray.dir_x, ray.ray.dir_y, ray.ray.dir_z}, ray.ray.tfar);
}

/// Assumed relative error of positions, directions and Embree's arithmetic, which covers many
/// single-precision roundings.
inline constexpr float kRoundingMargin = 1.0F / (1 << 18);

}  // namespace lenticule::render
