// SPDX-License-Identifier: Apache-2.0
#include "tests/support/oracles/ground_shadow_oracle.h"

#include <algorithm>
#include <cmath>
#include <map>

namespace lenticule::test {
namespace {

// By layer: the narrow one, the wide one.
constexpr double kDark[] = {0.45, 0.45};
constexpr double kRadius[] = {0.08, 0.25};
constexpr double kHeight[] = {0.25, 1.5};

// Points of the grid lie this part of a cell beside whole cells from the centre.
constexpr double kBeside = 0.381966;

double kernel(int n, double radius) {
  const double t = n / radius;
  return std::abs(t) < 1.0 ? std::pow(1.0 - t * t, 3) : 0.0;
}

double kernel_sum(double radius) {
  double sum = 0.0;
  for (int n = -static_cast<int>(radius) - 1; n <= radius + 1; ++n) sum += kernel(n, radius);
  return sum;
}

}  // namespace

OracleGroundShadow::OracleGroundShadow(const render::SceneDescription& scene, Vec3 centre)
    : centre_(centre) {
  bool first = true;
  for (const render::TriangleMesh& mesh : scene.meshes)
    for (const Vec3& p : mesh.positions) {
      low_ = first ? p : Vec3{std::min(low_.x, p.x), std::min(low_.y, p.y), std::min(low_.z, p.z)};
      high_ =
          first ? p : Vec3{std::max(high_.x, p.x), std::max(high_.y, p.y), std::max(high_.z, p.z)};
      first = false;
    }
  const Vec3 sides = high_ - low_;
  const double longer = std::max(sides.x, sides.z);
  size_ = std::min(std::max(std::cbrt(sides.x * sides.y * sides.z), longer / 4.0), longer * 2.0);
  cell_ = std::max(size_ / 100.0, longer / 254.0);
  first_i_ = static_cast<int>(std::floor((low_.x - centre.x) / cell_));
  first_j_ = static_cast<int>(std::floor((low_.z - centre.z) / cell_));
  columns_ = static_cast<int>(std::ceil((high_.x - centre.x) / cell_)) - first_i_ + 1;
  rows_ = static_cast<int>(std::ceil((high_.z - centre.z) / cell_)) - first_j_ + 1;
  for (int n = 0; n < 2; ++n)
    for (int j = 0; j < rows_; ++j)
      for (int i = 0; i < columns_; ++i)
        hidden_[n].push_back(hidden(scene, centre.x + (first_i_ + i + kBeside) * cell_,
                                    centre.z + (first_j_ + j + kBeside) * cell_,
                                    kHeight[n] * size_));
}

/// Returns what is hidden of the sky straight above a point of the ground, less the higher it is.
double OracleGroundShadow::hidden(const render::SceneDescription& scene, double x, double z,
                                  double highest) const {
  std::multimap<double, double> alphas;  // by height
  for (const render::TriangleMesh& mesh : scene.meshes) {
    const auto& material = *scene.materials[static_cast<size_t>(mesh.material)].pbr;
    using enum render::PbrMaterial::AlphaMode;
    const double alpha = material.alpha_mode == Opaque            ? 1.0
                         : material.alpha_mode == Blend           ? material.alpha
                         : material.alpha < material.alpha_cutoff ? 0.0
                                                                  : 1.0;
    for (const auto& triangle : mesh.triangles) {
      const Vec3 a = mesh.positions[triangle[0]], b = mesh.positions[triangle[1]],
                 c = mesh.positions[triangle[2]];
      const double area = (b.x - a.x) * (c.z - a.z) - (c.x - a.x) * (b.z - a.z);
      if (area == 0.0) continue;
      const double v = ((x - a.x) * (c.z - a.z) - (c.x - a.x) * (z - a.z)) / area;
      const double w = ((b.x - a.x) * (z - a.z) - (x - a.x) * (b.z - a.z)) / area;
      if (v < 0.0 || w < 0.0 || v + w > 1.0) continue;
      alphas.emplace(a.y + v * (b.y - a.y) + w * (c.y - a.y) - low_.y, alpha);
    }
  }
  double sum = 0.0, left = 1.0;
  for (const auto& [height, alpha] : alphas) {
    if (height < highest) sum += left * alpha * std::pow(1.0 - height / highest, 2);
    left *= 1.0 - alpha;
  }
  return sum;
}

double OracleGroundShadow::darkness(int i, int j) const {
  double sum = 0.0;
  for (size_t n = 0; n < 2; ++n) {
    const double radius = kRadius[n] * size_ / cell_;
    const double all = kernel_sum(radius);
    double layer = 0.0;
    for (int row = 0; row < rows_; ++row) {
      const double along = kernel(first_j_ + row - j, radius);
      if (along == 0.0) continue;
      for (int column = 0; column < columns_; ++column)
        layer += along * kernel(first_i_ + column - i, radius) *
                 hidden_[n][static_cast<size_t>(row * columns_ + column)];
    }
    sum += kDark[n] * layer / (all * all);
  }
  return sum;
}

double OracleGroundShadow::light_left(Vec3 origin, Vec3 direction) const {
  if (direction.y >= 0.0) return 1.0;
  const Vec3 at = origin + direction * ((low_.y - origin.y) / direction.y);
  const double u = (at.x - centre_.x) / cell_ - kBeside;
  const double v = (at.z - centre_.z) / cell_ - kBeside;
  const int i = static_cast<int>(std::floor(u)), j = static_cast<int>(std::floor(v));
  const double right = u - i, below = v - j;
  return 1.0 - (1 - below) * ((1 - right) * darkness(i, j) + right * darkness(i + 1, j)) -
         below * ((1 - right) * darkness(i, j + 1) + right * darkness(i + 1, j + 1));
}

}  // namespace lenticule::test
