// SPDX-License-Identifier: Apache-2.0
#include "render/accel/user_geometry.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <utility>

#include "render/accel/quadric_kernel.h"

namespace lenticule::render {
namespace {

/// Returns a float a few roundings below v: a box that is too small loses hits.
float rounded_down(double v) {
  constexpr float kBelow = -std::numeric_limits<float>::infinity();
  return std::nextafter(std::nextafter(static_cast<float>(v), kBelow), kBelow);
}
float rounded_up(double v) { return -rounded_down(-v); }

template <class Shape>
const Shape& shape_of(void* user_data, unsigned primitive) {
  return (*static_cast<const std::vector<Shape>*>(user_data))[primitive];
}

template <class Shape>
void bounds(const RTCBoundsFunctionArguments* arguments) {
  const Box box = box_of(shape_of<Shape>(arguments->geometryUserPtr, arguments->primID));
  RTCBounds& out = *arguments->bounds_o;
  out.lower_x = rounded_down(box.low.x);
  out.lower_y = rounded_down(box.low.y);
  out.lower_z = rounded_down(box.low.z);
  out.upper_x = rounded_up(box.high.x);
  out.upper_y = rounded_up(box.high.y);
  out.upper_z = rounded_up(box.high.z);
}

const quadric_kernel::Kernel& kernel() {
  static const quadric_kernel::Kernel& best = quadric_kernel_for(best_isa());
  return best;
}

void write(Vec3 v, double (&out)[3]) {
  out[0] = v.x;
  out[1] = v.y;
  out[2] = v.z;
}
quadric_kernel::Sphere lanes_shape(const SphereShape& sphere) {
  quadric_kernel::Sphere out{.centre = {}, .radius = sphere.radius};
  write(sphere.centre, out.centre);
  return out;
}
quadric_kernel::Cone lanes_shape(const ConeShape& cone) {
  quadric_kernel::Cone out{.base = {},
                           .axis = {},
                           .height = cone.height,
                           .base_radius = cone.base_radius,
                           .slope = cone.slope};
  write(cone.base, out.base);
  write(cone.axis, out.axis);
  return out;
}
quadric_kernel::Triangle lanes_shape(const WideTriangle& triangle) {
  quadric_kernel::Triangle out{
      .corner = {}, .normal = {}, .u_axis = {}, .v_axis = {}, .slope = {}, .edge_room = kEdgeRoom};
  write(triangle.corner[0], out.corner);
  write(triangle.normal, out.normal);
  write(triangle.u_axis, out.u_axis);
  write(triangle.v_axis, out.v_axis);
  write(triangle.slope, out.slope);
  return out;
}

/// Geometry and primitive numbers that a hit reports.
struct Numbers {
  uint32_t geometry, primitive;
};
template <class Shape>
Numbers numbers_of(const Shape&, const RTCIntersectFunctionNArguments& arguments) {
  return {arguments.geomID, arguments.primID};
}
Numbers numbers_of(const WideTriangle& triangle, const RTCIntersectFunctionNArguments&) {
  return {triangle.geometry, triangle.primitive};
}

/// Returns the functions that intersect a packet with a shape, and that test it for occlusion.
auto functions_for(const quadric_kernel::Sphere&) {
  return std::pair(kernel().intersect_sphere, kernel().occlude_sphere);
}
auto functions_for(const quadric_kernel::Cone&) {
  return std::pair(kernel().intersect_cone, kernel().occlude_cone);
}
auto functions_for(const quadric_kernel::Triangle&) {
  return std::pair(kernel().intersect_triangle, kernel().occlude_triangle);
}

/// AskedLanes holds a copy of the lanes that Embree asks about, which the kernel may write.
struct AskedLanes {
  alignas(64) std::array<int, quadric_kernel::kMostLanes> valid;

  template <class Arguments>
  explicit AskedLanes(const Arguments& arguments) {
    std::copy_n(arguments.valid, arguments.N, valid.begin());
  }
  quadric_kernel::Packet packet(unsigned lanes, void* rays) {
    return {
        .lanes = static_cast<int>(lanes), .valid = valid.data(), .rays = static_cast<float*>(rays)};
  }
};
bool takes_packets_of(unsigned lanes) {
  return lanes <= quadric_kernel::kMostLanes && lanes % static_cast<unsigned>(kernel().step) == 0;
}

template <class Arguments>
void report(const Arguments& arguments, const AskedLanes& met) {
  if (kCallbacksReportHits) std::copy_n(met.valid.begin(), arguments.N, arguments.valid);
}

/// Returns the distance to the shape along ray i of a packet, or the ray's own end.
template <class Shape>
double distance(const Shape& shape, RTCRayN* ray, unsigned n, unsigned i) {
  const Vec3 origin{RTCRayN_org_x(ray, n, i), RTCRayN_org_y(ray, n, i), RTCRayN_org_z(ray, n, i)};
  const Vec3 direction{RTCRayN_dir_x(ray, n, i), RTCRayN_dir_y(ray, n, i),
                       RTCRayN_dir_z(ray, n, i)};
  return first_root(meet(shape, origin, direction), RTCRayN_tnear(ray, n, i),
                    RTCRayN_tfar(ray, n, i));
}

template <class Shape>
void intersect(const RTCIntersectFunctionNArguments* arguments) {
  const Shape& shape = shape_of<Shape>(arguments->geometryUserPtr, arguments->primID);
  const unsigned n = arguments->N;
  const Numbers numbers = numbers_of(shape, *arguments);
  if (takes_packets_of(n)) {
    AskedLanes lanes(*arguments);
    const auto of_kernel = lanes_shape(shape);
    functions_for(of_kernel).first(of_kernel, numbers.geometry, numbers.primitive,
                                   lanes.packet(n, arguments->rayhit));
    return report(*arguments, lanes);
  }
  RTCRayN* ray = RTCRayHitN_RayN(arguments->rayhit, n);
  RTCHitN* hit = RTCRayHitN_HitN(arguments->rayhit, n);
  for (unsigned i = 0; i < n; ++i) {
    if (arguments->valid[i] == 0) continue;
    const auto t = static_cast<float>(distance(shape, ray, n, i));
    // Rounding to single precision may put t behind the current hit.
    const bool met = t < RTCRayN_tfar(ray, n, i);
    if (kCallbacksReportHits) arguments->valid[i] = met ? -1 : 0;
    if (!met) continue;
    RTCRayN_tfar(ray, n, i) = t;
    RTCHitN_geomID(hit, n, i) = numbers.geometry;
    RTCHitN_primID(hit, n, i) = numbers.primitive;
    RTCHitN_instID(hit, n, i, 0) = RTC_INVALID_GEOMETRY_ID;
  }
}

template <class Shape>
void occlude(const RTCOccludedFunctionNArguments* arguments) {
  const Shape& shape = shape_of<Shape>(arguments->geometryUserPtr, arguments->primID);
  const unsigned n = arguments->N;
  if (takes_packets_of(n)) {
    AskedLanes lanes(*arguments);
    const auto of_kernel = lanes_shape(shape);
    functions_for(of_kernel).second(of_kernel, lanes.packet(n, arguments->ray));
    return report(*arguments, lanes);
  }
  for (unsigned i = 0; i < n; ++i) {
    if (arguments->valid[i] == 0) continue;
    const bool met = distance(shape, arguments->ray, n, i) < RTCRayN_tfar(arguments->ray, n, i);
    if (kCallbacksReportHits) arguments->valid[i] = met ? -1 : 0;
    if (met) RTCRayN_tfar(arguments->ray, n, i) = -std::numeric_limits<float>::infinity();
  }
}

template <class Shape>
EmbreeGeometry make_geometry(RTCDevice device, const std::vector<Shape>& shapes) {
  EmbreeGeometry geometry(rtcNewGeometry(device, RTC_GEOMETRY_TYPE_USER));
  if (!geometry) return geometry;
  rtcSetGeometryUserPrimitiveCount(geometry.get(), static_cast<unsigned>(shapes.size()));
  // Embree's pointer is not const, but the callbacks only read.
  rtcSetGeometryUserData(geometry.get(), const_cast<std::vector<Shape>*>(&shapes));
  rtcSetGeometryBoundsFunction(
      geometry.get(), [](const RTCBoundsFunctionArguments* a) { bounds<Shape>(a); }, nullptr);
  rtcSetGeometryIntersectFunction(
      geometry.get(), [](const RTCIntersectFunctionNArguments* a) { intersect<Shape>(a); });
  rtcSetGeometryOccludedFunction(geometry.get(),
                                 [](const RTCOccludedFunctionNArguments* a) { occlude<Shape>(a); });
  rtcSetGeometryMask(geometry.get(), ~0U);
  rtcCommitGeometry(geometry.get());
  return geometry;
}

}  // namespace

const quadric_kernel::Kernel& quadric_kernel_for(Isa isa) {
  return LENTICULE_SELECT_KERNEL(isa, kQuadricKernel);
}

EmbreeGeometry make_sphere_geometry(RTCDevice device, const std::vector<SphereShape>& spheres) {
  return make_geometry(device, spheres);
}

EmbreeGeometry make_cone_geometry(RTCDevice device, const std::vector<ConeShape>& cones) {
  return make_geometry(device, cones);
}

EmbreeGeometry make_wide_geometry(RTCDevice device, const std::vector<WideTriangle>& triangles) {
  return make_geometry(device, triangles);
}

}  // namespace lenticule::render
