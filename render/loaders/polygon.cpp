// SPDX-License-Identifier: Apache-2.0
#include "render/loaders/polygon.h"

#include <algorithm>
#include <cmath>

namespace lenticule::render {
namespace {

/// Returns twice the signed area of a triangle.
double turn(Vec2 a, Vec2 b, Vec2 c) {
  return (b.x - a.x) * (c.y - a.y) - (b.y - a.y) * (c.x - a.x);
}

/// Projects along the axis in which the polygon appears largest. There is no rotation and so no
/// rounding: collinear corners stay collinear, and counter-clockwise outlines stay so.
Vec2 project(Vec3 p, Vec3 normal) {
  const Vec3 size{std::abs(normal.x), std::abs(normal.y), std::abs(normal.z)};
  if (size.x >= size.y && size.x >= size.z) return normal.x > 0 ? Vec2{p.y, p.z} : Vec2{p.z, p.y};
  if (size.y >= size.z) return normal.y > 0 ? Vec2{p.z, p.x} : Vec2{p.x, p.z};
  return normal.z > 0 ? Vec2{p.x, p.y} : Vec2{p.y, p.x};
}

/// Strictness states how much of the outline an ear may contain. A simple polygon needs only the
/// first level; the others ensure termination for outlines that touch or cross themselves.
enum class Strictness { NothingInside, NothingStrictlyInside, Anything };

class EarClipper {
 public:
  explicit EarClipper(std::vector<Vec2> points) : points_(std::move(points)) {
    const size_t n = points_.size();
    previous_.resize(n);
    next_.resize(n);
    queued_.assign(n, true);
    removed_.assign(n, false);
    for (size_t i = 0; i < n; ++i) {
      next_[i] = static_cast<uint32_t>(i + 1 == n ? 0 : i + 1);
      previous_[i] = static_cast<uint32_t>(i == 0 ? n - 1 : i - 1);
    }
    for (size_t i = 0; i < n; ++i) {
      candidates_.push_back(static_cast<uint32_t>(i));
      if (concave(static_cast<uint32_t>(i))) concave_.push_back(static_cast<uint32_t>(i));
    }
  }

  Triangulation run() {
    size_t left = points_.size();
    while (left > 3) {
      const uint32_t ear = next_ear();
      clip(ear);
      --left;
    }
    const uint32_t last = first_left();
    if (turn_at(last) != 0.0) result_.triangles.push_back({previous_[last], last, next_[last]});
    return std::move(result_);
  }

 private:
  [[nodiscard]] double turn_at(uint32_t i) const {
    return turn(points_[previous_[i]], points_[i], points_[next_[i]]);
  }
  [[nodiscard]] bool concave(uint32_t i) const { return turn_at(i) <= 0.0; }

  /// Returns a corner that may be cut off, from the queue; the rules are relaxed if there is none.
  uint32_t next_ear() {
    while (true) {
      while (!candidates_.empty()) {
        const uint32_t i = candidates_.back();
        candidates_.pop_back();
        queued_[i] = false;
        if (!removed_[i] && is_ear(i)) return i;
      }
      if (strictness_ == Strictness::Anything) return first_left();
      relax();
    }
  }

  void relax() {
    const bool first = strictness_ == Strictness::NothingInside;
    strictness_ = first ? Strictness::NothingStrictlyInside : Strictness::Anything;
    if (!first) result_.simple = false;
    const uint32_t start = first_left();
    uint32_t i = start;
    do {
      push(i);
      i = next_[i];
    } while (i != start);
  }

  bool is_ear(uint32_t i) {
    const double size = turn_at(i);
    if (size < 0.0) return false;
    // A straight corner has no area; it may be cut unless the outline turns back there.
    if (size == 0.0) return strictness_ != Strictness::NothingInside || !turns_back(i);
    if (strictness_ == Strictness::Anything) return true;
    const uint32_t a = previous_[i];
    const uint32_t c = next_[i];
    for (size_t k = 0; k < concave_.size();) {
      const uint32_t j = concave_[k];
      if (removed_[j] || !concave(j)) {  // corners only become convex: drop it
        concave_[k] = concave_.back();
        concave_.pop_back();
        continue;
      }
      if (j != a && j != c && j != i && blocks(points_[j], a, i, c)) return false;
      ++k;
    }
    return true;
  }

  [[nodiscard]] bool turns_back(uint32_t i) const {
    const Vec2 in = points_[i] - points_[previous_[i]];
    const Vec2 out = points_[next_[i]] - points_[i];
    return in.x * out.x + in.y * out.y < 0.0;
  }

  [[nodiscard]] bool blocks(Vec2 p, uint32_t a, uint32_t b, uint32_t c) const {
    const Vec2 pa = points_[a];
    const Vec2 pb = points_[b];
    const Vec2 pc = points_[c];
    if (p == pa || p == pb || p == pc) return false;
    const double ab = turn(pa, pb, p);
    const double bc = turn(pb, pc, p);
    const double ca = turn(pc, pa, p);
    if (strictness_ == Strictness::NothingInside) return ab >= 0 && bc >= 0 && ca >= 0;
    return ab > 0 && bc > 0 && ca > 0;
  }

  void clip(uint32_t i) {
    const uint32_t a = previous_[i];
    const uint32_t c = next_[i];
    if (turn_at(i) != 0.0) result_.triangles.push_back({a, i, c});
    next_[a] = c;
    previous_[c] = a;
    removed_[i] = true;
    if (first_left_ == i) first_left_ = c;
    push(a);
    push(c);
  }

  void push(uint32_t i) {
    if (queued_[i]) return;
    queued_[i] = true;
    candidates_.push_back(i);
  }

  [[nodiscard]] uint32_t first_left() const { return first_left_; }

  std::vector<Vec2> points_;
  std::vector<uint32_t> previous_;
  std::vector<uint32_t> next_;
  std::vector<uint32_t> candidates_;
  std::vector<uint32_t> concave_;
  std::vector<bool> queued_;
  std::vector<bool> removed_;
  uint32_t first_left_ = 0;
  Strictness strictness_ = Strictness::NothingInside;
  Triangulation result_;
};

/// Returns the indices of the corners that differ from their predecessor.
std::vector<uint32_t> distinct_corners(std::span<const Vec3> corners) {
  std::vector<uint32_t> kept;
  for (size_t i = 0; i < corners.size(); ++i)
    if (kept.empty() || !(corners[i] == corners[kept.back()]))
      kept.push_back(static_cast<uint32_t>(i));
  while (kept.size() > 1 && corners[kept.back()] == corners[kept.front()]) kept.pop_back();
  return kept;
}

double largest_extent(std::span<const Vec3> corners) {
  Vec3 low = corners[0];
  Vec3 high = corners[0];
  for (const Vec3 p : corners) {
    low = {std::min(low.x, p.x), std::min(low.y, p.y), std::min(low.z, p.z)};
    high = {std::max(high.x, p.x), std::max(high.y, p.y), std::max(high.z, p.z)};
  }
  return std::max({high.x - low.x, high.y - low.y, high.z - low.z});
}

/// Returns true if the polygon is convex and winds once, so that a triangle fan covers it.
bool is_convex(const std::vector<Vec2>& points) {
  const size_t n = points.size();
  for (size_t i = 0; i < n; ++i)
    if (turn(points[i], points[(i + 1) % n], points[(i + 2) % n]) <= 0.0) return false;
  for (size_t i = 2; i + 1 < n; ++i)
    if (turn(points[0], points[i], points[i + 1]) <= 0.0) return false;
  return true;
}

Triangulation fan(size_t corners) {
  Triangulation result;
  for (uint32_t i = 1; i + 1 < corners; ++i) result.triangles.push_back({0, i, i + 1});
  return result;
}

}  // namespace

Vec3 polygon_area_vector(std::span<const Vec3> corners) {
  Vec3 sum;
  for (size_t i = 1; i + 1 < corners.size(); ++i)
    sum += cross(corners[i] - corners[0], corners[i + 1] - corners[0]);
  return sum;
}

Triangulation triangulate(std::span<const Vec3> corners) {
  const std::vector<uint32_t> kept = distinct_corners(corners);
  if (kept.size() < 3) return {};
  const Vec3 normal = polygon_area_vector(corners);
  const double extent = largest_extent(corners);
  constexpr double kFlat = 1e-14;
  if (!(length(normal) > kFlat * extent * extent)) return {};

  std::vector<Vec2> points;
  points.reserve(kept.size());
  for (const uint32_t i : kept) points.push_back(project(corners[i] - corners[0], normal));
  Triangulation result =
      is_convex(points) ? fan(points.size()) : EarClipper(std::move(points)).run();
  for (auto& triangle : result.triangles)
    for (uint32_t& corner : triangle) corner = kept[corner];
  return result;
}

}  // namespace lenticule::render
