// SPDX-License-Identifier: Apache-2.0
#include "render/scene/subject.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <initializer_list>
#include <iterator>

#include "base/interval.h"

namespace lenticule::render {
namespace {

constexpr int kColumns = 128, kRows = 96;
/// Every eighth sample in each direction proposes its plane.
constexpr int kProposals = 8;
/// Share of the picture's width by which points of a plane may lie off it.
constexpr double kRoom = 0.004;
/// Cosine between the normals of samples of one plane (14 degrees: floors may be uneven).
constexpr double kSameNormal = 0.97;
/// Least share of the samples that a plane of the setting covers, and largest share behind it: the
/// sides of a floor that is a slab are seen below it.
constexpr double kLeastCovered = 0.05, kMostBehind = 0.125;

/// Largest number of tests of a sample against a triangle: a file may have millions of triangles
/// that all cover the picture. Beyond it, no setting is told.
constexpr int64_t kMostTests = int64_t{1} << 29;

/// Sample is where a ray from the eye meets the scene. Coordinates are relative to the eye.
struct Sample {
  double depth = HUGE_VAL;  ///< along the view
  Vec3 at{}, normal{};      ///< the normal is unit and on the viewer's side
  [[nodiscard]] double before(Vec3 point) const { return dot(normal, point - at); }
};

class DepthBuffer {
 public:
  explicit DepthBuffer(const PictureView& view)
      : forward_(normalized(view.centre - view.eye)), samples_(kColumns * kRows) {
    const double distance = length(view.centre - view.eye);
    right_ = view.right / distance;
    up_ = view.up / distance;
    nearest_ = std::clamp(view.nearest, 1e-6 * distance, distance);
  }

  void add(Vec3 a, Vec3 b, Vec3 c) {
    Interval columns, rows, depth;
    for (const Vec3 p : {a, b, c}) {
      const double z = dot(forward_, p);
      depth.extend(z);
      columns.extend((dot(right_, p) / (dot(right_, right_) * z) + 1.0) / 2.0 * kColumns - 0.5);
      rows.extend((dot(up_, p) / (dot(up_, up_) * z) + 1.0) / 2.0 * kRows - 0.5);
    }
    if (!(depth.high > nearest_)) return;
    if (depth.low < nearest_) columns = rows = kEverywhere;
    const Vec3 normal = normalized(cross(b - a, c - a));
    // A ray meets the triangle if it is on one side of the planes through the eye and each edge.
    const Vec3 ab = cross(a, b), bc = cross(b, c), ca = cross(c, a);
    const auto [left, right] = cells(columns, kColumns);
    const auto [low, high] = cells(rows, kRows);
    if (right < left || high < low) return;
    tests_ += int64_t{right - left + 1} * (high - low + 1);
    if (tests_ > kMostTests) return;
    for (int row = low; row <= high; ++row)
      for (int column = left; column <= right; ++column) {
        const Vec3 ray = forward_ + right_ * ((2 * column + 1.0) / kColumns - 1.0) +
                         up_ * ((2 * row + 1.0) / kRows - 1.0);
        const auto [least, most] = std::minmax({dot(ab, ray), dot(bc, ray), dot(ca, ray)});
        const double z = dot(normal, a) / dot(normal, ray);
        Sample& sample = samples_[static_cast<size_t>(row * kColumns + column)];
        if ((least >= 0.0 || most <= 0.0) && z > nearest_ && z < sample.depth)
          sample = {z, ray * z, dot(normal, ray) < 0.0 ? normal : -normal};
      }
  }

  /// Returns the planes of the setting, each as one sample of it.
  [[nodiscard]] std::vector<Sample> setting(double room, Vec3 turns_about) const {
    std::vector<Sample> planes;
    if (tests_ > kMostTests) return planes;
    for (int row = kProposals / 2; row < kRows; row += kProposals)
      for (int column = kProposals / 2; column < kColumns; column += kProposals) {
        const Sample& sample = samples_[static_cast<size_t>(row * kColumns + column)];
        const bool is_known = std::ranges::any_of(
            planes, [&](const Sample& plane) { return plane.before(sample.at) <= room; });
        const bool level = turns_about == Vec3{} || dot(turns_about, sample.normal) >= kSameNormal;
        if (level && !is_known && is_setting(sample, room)) planes.push_back(sample);
      }
    return planes;
  }

 private:
  /// Returns the first and the last sample of a range.
  static std::array<int, 2> cells(const Interval& range, int count) {
    return {static_cast<int>(std::ceil(std::clamp(range.low, 0.0, count + 0.0))),
            static_cast<int>(std::floor(std::clamp(range.high, -1.0, count - 1.0)))};
  }

  [[nodiscard]] bool is_setting(const Sample& plane, double room) const {
    double met = 0.0, covered = 0.0, behind = 0.0;
    for (const Sample& sample : samples_) {
      if (sample.depth == HUGE_VAL) continue;
      const double before = plane.before(sample.at);
      met += 1.0;
      behind += before < -room ? 1.0 : 0.0;
      covered += std::abs(before) <= room && dot(plane.normal, sample.normal) > kSameNormal;
    }
    return plane.depth < HUGE_VAL && covered >= kLeastCovered * met && behind <= kMostBehind * met;
  }

  Vec3 forward_, right_, up_;  ///< right_ and up_ reach from the middle to the border at depth 1
  double nearest_;
  int64_t tests_ = 0;
  std::vector<Sample> samples_;
};

}  // namespace

std::optional<SceneDescription> subject_of(const SceneDescription& scene, const PictureView& view) {
  DepthBuffer buffer(view);
  for_each_mesh(scene, [&](const TriangleMesh& mesh) {
    for (const auto& [a, b, c] : mesh.triangles)
      buffer.add(mesh.positions[a] - view.eye, mesh.positions[b] - view.eye,
                 mesh.positions[c] - view.eye);
  });
  const double room = kRoom * 2.0 * length(view.right);
  const std::vector<Sample> setting = buffer.setting(room, view.turns_about);
  if (setting.empty()) return std::nullopt;
  const auto stands_out = [&](std::initializer_list<Vec3> points, double radius) {
    return std::ranges::all_of(setting, [&](const Sample& plane) {
      return std::ranges::any_of(
          points, [&](Vec3 p) { return plane.before(p - view.eye) + radius > room; });
    });
  };
  SceneDescription subject;
  for_each_mesh(scene, [&](const TriangleMesh& mesh) {
    TriangleMesh& kept = subject.meshes.emplace_back();
    kept.positions = mesh.positions;
    std::ranges::copy_if(mesh.triangles, std::back_inserter(kept.triangles), [&](const auto& t) {
      const auto& p = mesh.positions;
      return stands_out({p[t[0]], p[t[1]], p[t[2]]}, 0.0);
    });
  });
  std::ranges::copy_if(scene.spheres, std::back_inserter(subject.spheres),
                       [&](const Sphere& s) { return stands_out({s.centre}, s.radius); });
  std::ranges::copy_if(scene.cones, std::back_inserter(subject.cones), [&](const Cone& c) {
    return stands_out({c.base, c.apex}, std::max(c.base_radius, c.apex_radius));
  });
  return subject;
}

}  // namespace lenticule::render
