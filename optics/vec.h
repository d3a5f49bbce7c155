// SPDX-License-Identifier: Apache-2.0
// Two- and three-vectors, for any scalar type; boxes and affine maps.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <limits>

namespace lenticule {

template <class T>
struct Vec2T {
  T x{}, y{};

  friend constexpr Vec2T operator+(Vec2T a, Vec2T b) { return {a.x + b.x, a.y + b.y}; }
  friend constexpr Vec2T operator-(Vec2T a, Vec2T b) { return {a.x - b.x, a.y - b.y}; }
  friend constexpr Vec2T operator*(Vec2T a, T s) { return {a.x * s, a.y * s}; }
  friend constexpr bool operator==(const Vec2T&, const Vec2T&) = default;
};

template <class T>
struct Vec3T {
  T x{}, y{}, z{};

  constexpr Vec3T() = default;
  constexpr Vec3T(T x_, T y_, T z_) : x(x_), y(y_), z(z_) {}
  template <class U>
  constexpr explicit Vec3T(const Vec3T<U>& o)
      : x(static_cast<T>(o.x)), y(static_cast<T>(o.y)), z(static_cast<T>(o.z)) {}

  constexpr Vec3T& operator+=(Vec3T b) { return *this = *this + b; }

  friend constexpr Vec3T operator+(Vec3T a, Vec3T b) { return {a.x + b.x, a.y + b.y, a.z + b.z}; }
  friend constexpr Vec3T operator-(Vec3T a, Vec3T b) { return {a.x - b.x, a.y - b.y, a.z - b.z}; }
  friend constexpr Vec3T operator-(Vec3T a) { return {-a.x, -a.y, -a.z}; }
  friend constexpr Vec3T operator*(Vec3T a, T s) { return {a.x * s, a.y * s, a.z * s}; }
  friend constexpr Vec3T operator*(T s, Vec3T a) { return a * s; }
  /// Multiplies component by component, as colours need.
  friend constexpr Vec3T operator*(Vec3T a, Vec3T b) { return {a.x * b.x, a.y * b.y, a.z * b.z}; }
  friend constexpr Vec3T operator/(Vec3T a, T s) { return {a.x / s, a.y / s, a.z / s}; }
  friend constexpr bool operator==(const Vec3T&, const Vec3T&) = default;
};

template <class T>
constexpr T dot(Vec3T<T> a, Vec3T<T> b) {
  return a.x * b.x + a.y * b.y + a.z * b.z;
}
template <class T>
constexpr Vec3T<T> cross(Vec3T<T> a, Vec3T<T> b) {
  return {a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x};
}
template <class T>
T length(Vec3T<T> a) {
  return std::sqrt(dot(a, a));
}
/// Returns a vector of length 1; the zero vector stays zero, so that callers can test for it.
template <class T>
Vec3T<T> normalized(Vec3T<T> a) {
  const T l = length(a);
  return l > T(0) ? a / l : a;
}
/// Returns the smaller one of each component.
template <class T>
Vec3T<T> min(Vec3T<T> a, Vec3T<T> b) {
  return {std::min(a.x, b.x), std::min(a.y, b.y), std::min(a.z, b.z)};
}
template <class T>
Vec3T<T> max(Vec3T<T> a, Vec3T<T> b) {
  return {std::max(a.x, b.x), std::max(a.y, b.y), std::max(a.z, b.z)};
}
template <class T>
T smallest(Vec3T<T> a) {
  return std::min({a.x, a.y, a.z});
}
template <class T>
T largest(Vec3T<T> a) {
  return std::max({a.x, a.y, a.z});
}
/// Returns the largest absolute component.
template <class T>
T largest_size(Vec3T<T> a) {
  return std::max({std::abs(a.x), std::abs(a.y), std::abs(a.z)});
}
template <class T>
bool is_finite(Vec3T<T> a) {
  return std::isfinite(a.x) && std::isfinite(a.y) && std::isfinite(a.z);
}

using Vec2 = Vec2T<double>;
using Vec3 = Vec3T<double>;
using Vec3f = Vec3T<float>;

/// Box is parallel to the axes, and empty until its first extend().
struct Box {
  Vec3 low = Vec3{1, 1, 1} * std::numeric_limits<double>::infinity();
  Vec3 high = -low;

  void extend(Vec3 p) {
    low = min(low, p);
    high = max(high, p);
  }
  void extend(const Box& box) {
    low = min(low, box.low);
    high = max(high, box.high);
  }
  [[nodiscard]] bool empty() const {
    return !(low.x <= high.x && low.y <= high.y && low.z <= high.z);
  }
  /// Returns the box extended by `by` to all sides.
  [[nodiscard]] Box widened(double by) const {
    const Vec3 all{by, by, by};
    return {low - all, high + all};
  }
  [[nodiscard]] std::array<Vec3, 8> corners() const {
    std::array<Vec3, 8> out;
    for (size_t n = 0; n < out.size(); ++n)
      out[n] = {(n & 1) != 0 ? high.x : low.x, (n & 2) != 0 ? high.y : low.y,
                (n & 4) != 0 ? high.z : low.z};
    return out;
  }
};

/// Affine maps p -> column_x p.x + column_y p.y + column_z p.z + origin. Variables are named
/// target_from_source.
struct Affine {
  Vec3 column_x{1, 0, 0}, column_y{0, 1, 0}, column_z{0, 0, 1}, origin{0, 0, 0};

  [[nodiscard]] constexpr Vec3 vector(Vec3 v) const {
    return column_x * v.x + column_y * v.y + column_z * v.z;
  }
  [[nodiscard]] constexpr Vec3 point(Vec3 p) const { return vector(p) + origin; }
  [[nodiscard]] constexpr double determinant() const {
    return dot(column_x, cross(column_y, column_z));
  }
  /// Requires a non-zero determinant.
  [[nodiscard]] constexpr Affine inverse() const {
    const double inv_det = 1.0 / determinant();
    const Vec3 r0 = cross(column_y, column_z) * inv_det;
    const Vec3 r1 = cross(column_z, column_x) * inv_det;
    const Vec3 r2 = cross(column_x, column_y) * inv_det;
    Affine inv{{r0.x, r1.x, r2.x}, {r0.y, r1.y, r2.y}, {r0.z, r1.z, r2.z}, {}};
    inv.origin = -inv.vector(origin);
    return inv;
  }
  friend constexpr Affine operator*(const Affine& outer, const Affine& inner) {
    return {outer.vector(inner.column_x), outer.vector(inner.column_y),
            outer.vector(inner.column_z), outer.point(inner.origin)};
  }
};

}  // namespace lenticule
