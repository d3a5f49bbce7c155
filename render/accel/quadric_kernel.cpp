// SPDX-License-Identifier: Apache-2.0
#include "render/accel/quadric_kernel.h"

#include "base/lanes.h"
#include "render/accel/packet_fields.h"

namespace lenticule::render::LENTICULE_ISA_NAMESPACE {
namespace {

using namespace lanes;
using namespace quadric_kernel;
using packet_kernel::Field;

constexpr int kStep = kDoubles;  ///< lanes per step
constexpr int kInstance = packet_kernel::kGeometry + 1;
constexpr uint32_t kNone = ~0U;

// Parts of a packet, in Embree's types and in double precision. Embree's arrays may have any
// alignment.
using Floats = Vector<float, kStep>;
using Words = Vector<uint32_t, kStep>;
using Masks = Vector<int32_t, kStep>;

inline Unaligned<Floats>& floats_at(const Packet& packet, int field, int first) {
  return vector_at<Floats>(packet.rays + field * packet.lanes + first);
}
inline Doubles wide(const Unaligned<Floats>& floats) {
  return __builtin_convertvector(floats.v, Doubles);
}

struct Doubles3 {
  Doubles x, y, z;
};
inline Doubles3 point_at(const Packet& packet, int field, int first) {
  return {wide(floats_at(packet, field, first)), wide(floats_at(packet, field + 1, first)),
          wide(floats_at(packet, field + 2, first))};
}
inline Doubles dot(const Doubles3& a, const Doubles3& b) {
  return a.x * b.x + a.y * b.y + a.z * b.z;
}
inline Doubles3 spread(const double (&v)[3]) {
  return {Doubles{} + v[0], Doubles{} + v[1], Doubles{} + v[2]};
}
inline Doubles3 operator+(const Doubles3& a, const Doubles3& b) {
  return {a.x + b.x, a.y + b.y, a.z + b.z};
}
inline Doubles3 operator-(const Doubles3& a, const Doubles3& b) {
  return {a.x - b.x, a.y - b.y, a.z - b.z};
}
inline Doubles3 operator*(const Doubles3& a, const Doubles& s) {
  return {a.x * s, a.y * s, a.z * s};
}

/// Returns the first of two ascending roots that lies inside the ray, or the ray's end.
/// `low_counts` and `high_counts` mark the lanes in which the roots exist.
inline Doubles first_root(const Doubles& low, const DoubleMasks& low_counts, const Doubles& high,
                          const DoubleMasks& high_counts, const Doubles& near, const Doubles& far) {
  const Doubles second = (high_counts & (high > near) & (high < far)) ? high : far;
  return (low_counts & (low > near) & (low < far)) ? low : second;
}

inline Doubles distance(const Sphere& sphere, const Doubles3& origin, const Doubles3& direction,
                        const Doubles& near, const Doubles& far) {
  const Doubles3 centre = spread(sphere.centre);
  const Doubles per_squared = 1.0 / dot(direction, direction);
  const Doubles nearest = dot(centre - origin, direction) * per_squared;
  const Doubles3 off = origin + direction * nearest - centre;
  const Doubles inside = sphere.radius * sphere.radius - dot(off, off);
  const DoubleMasks meets = inside >= 0.0;
  const Doubles half = root(meets ? inside * per_squared : Doubles{});
  return first_root(nearest - half, meets, nearest + half, meets, near, far);
}

inline Doubles distance(const Cone& cone, const Doubles3& origin, const Doubles3& direction,
                        const Doubles& near, const Doubles& far) {
  const Doubles3 axis = spread(cone.axis);
  const Doubles3 from_base = origin - spread(cone.base);
  const Doubles along = dot(from_base, axis);
  const Doubles along_step = dot(direction, axis);
  const Doubles3 across = from_base - axis * along;
  const Doubles3 across_step = direction - axis * along_step;
  const Doubles radius = cone.base_radius + cone.slope * along;
  const Doubles radius_step = cone.slope * along_step;
  const Doubles a = dot(across_step, across_step) - radius_step * radius_step;
  const Doubles half_b = dot(across, across_step) - radius * radius_step;
  const Doubles c = dot(across, across) - radius * radius;

  const Doubles discriminant = half_b * half_b - a * c;
  const DoubleMasks real = discriminant >= 0.0;
  const Doubles size = root(real ? discriminant : Doubles{});
  // A half_b of -0 counts as negative, like std::copysign does.
  const Doubles signed_size = reinterpret_cast<DoubleMasks>(half_b) < 0 ? -size : size;
  const Doubles q = -(half_b + signed_size);
  const DoubleMasks flat = a == 0.0;
  const DoubleMasks at_zero = q == 0.0;
  const Doubles by_q = c / q, by_a = flat ? by_q : q / a;
  const Doubles low = at_zero ? Doubles{} : (by_q < by_a ? by_q : by_a);
  const Doubles high = at_zero ? Doubles{} : (by_q < by_a ? by_a : by_q);
  const DoubleMasks roots = real & ~(at_zero & flat);
  const auto on_cone = [&](const Doubles& t) {
    const Doubles s = along + t * along_step;
    return roots & (s >= 0.0) & (s <= cone.height);
  };
  return first_root(low, on_cone(low), high, on_cone(high), near, far);
}

inline Doubles absolute(const Doubles& v) {
  return reinterpret_cast<Doubles>(reinterpret_cast<DoubleMasks>(v) & 0x7fffffffffffffff);
}
inline Doubles larger(const Doubles& a, const Doubles& b) { return a < b ? b : a; }

inline Doubles distance(const Triangle& triangle, const Doubles3& origin, const Doubles3& direction,
                        const Doubles& near, const Doubles& far) {
  const Doubles3 corner = spread(triangle.corner), normal = spread(triangle.normal);
  const Doubles3 from_corner = origin - corner;
  const Doubles t = -dot(from_corner, normal) / dot(direction, normal);
  const Doubles3 at = from_corner + direction * t;
  const Doubles3 p = at + corner;
  const Doubles room =
      triangle.edge_room * larger(larger(absolute(p.x), absolute(p.y)), absolute(p.z));
  const Doubles u = dot(at, spread(triangle.u_axis)), v = dot(at, spread(triangle.v_axis));
  const DoubleMasks inside = (u >= -(room * triangle.slope[0])) &
                             (v >= -(room * triangle.slope[1])) &
                             (u + v <= 1.0 + room * triangle.slope[2]);
  return first_root(t, inside, t, inside, near, far);
}

template <class Shape>
inline Doubles distance(const Shape& shape, const Packet& packet, int first) {
  return distance(shape, point_at(packet, packet_kernel::kOriginX, first),
                  point_at(packet, packet_kernel::kDirectionX, first),
                  wide(floats_at(packet, packet_kernel::kTNear, first)),
                  wide(floats_at(packet, packet_kernel::kTFar, first)));
}

template <class Shape>
void intersect(const Shape& shape, uint32_t geometry, uint32_t primitive, const Packet& packet) {
  for (int first = 0; first < packet.lanes; first += kStep) {
    Unaligned<Masks>& lanes = vector_at<Masks>(packet.valid + first);
    Unaligned<Floats>& far = floats_at(packet, packet_kernel::kTFar, first);
    const Floats t = __builtin_convertvector(distance(shape, packet, first), Floats);
    // Rounding to single precision may put t behind the current hit.
    const Masks met = lanes.v & (t < far.v);
    far.v = met ? t : far.v;
    const auto set = [&](int field, uint32_t value) {
      auto& words = vector_at<Words>(packet.rays + field * packet.lanes + first);
      words.v = met ? Words{} + value : words.v;
    };
    set(packet_kernel::kPrimitive, primitive);
    set(packet_kernel::kGeometry, geometry);
    set(kInstance, kNone);
    lanes.v = met;
  }
}

template <class Shape>
void occlude(const Shape& shape, const Packet& packet) {
  for (int first = 0; first < packet.lanes; first += kStep) {
    Unaligned<Masks>& lanes = vector_at<Masks>(packet.valid + first);
    Unaligned<Floats>& far = floats_at(packet, packet_kernel::kTFar, first);
    const DoubleMasks nearer = distance(shape, packet, first) < wide(far);
    const Masks met = lanes.v & __builtin_convertvector(nearer, Masks);
    far.v = met ? Floats{} - __builtin_inff() : far.v;
    lanes.v = met;
  }
}

}  // namespace

extern const quadric_kernel::Kernel kQuadricKernel;
const quadric_kernel::Kernel kQuadricKernel{.step = kStep,
                                            .intersect_sphere = intersect<Sphere>,
                                            .occlude_sphere = occlude<Sphere>,
                                            .intersect_cone = intersect<Cone>,
                                            .occlude_cone = occlude<Cone>,
                                            .intersect_triangle = intersect<Triangle>,
                                            .occlude_triangle = occlude<Triangle>};

}  // namespace lenticule::render::LENTICULE_ISA_NAMESPACE
