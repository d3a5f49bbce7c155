// SPDX-License-Identifier: Apache-2.0
#include "calib/measure/panel_map.h"

#include <Eigen/Core>
#include <algorithm>
#include <array>
#include <cmath>

#include "base/statistics.h"
#include "calib/linear_algebra.h"

namespace lenticule::calib {
namespace {

constexpr size_t kFewestSightings = 30;
/// Sightings further off than this many typical errors count as wrong.
constexpr double kOutlier = 5.0;
constexpr int kRounds = 4;

/// Normalizer shifts and scales points so that their coordinates are about one: otherwise the
/// normal equations of a homography lose all digits.
struct Normalizer {
  Vec2 middle;
  double scale = 1.0;

  template <class PointOf>
  Normalizer(const std::vector<Sighting>& sightings, const PointOf& point) {
    for (const Sighting& s : sightings) middle = middle + point(s);
    middle = middle * (1.0 / static_cast<double>(sightings.size()));
    double spread = 0.0;
    for (const Sighting& s : sightings) {
      const Vec2 d = point(s) - middle;
      spread += d.x * d.x + d.y * d.y;
    }
    spread = std::sqrt(spread / static_cast<double>(sightings.size()));
    scale = spread > 0.0 ? 1.0 / spread : 1.0;
  }
  [[nodiscard]] Vec2 of(Vec2 p) const { return (p - middle) * scale; }
  [[nodiscard]] Eigen::Matrix3d matrix() const {
    Eigen::Matrix3d m;
    m << scale, 0, -scale * middle.x, 0, scale, -scale * middle.y, 0, 0, 1;
    return m;
  }
  [[nodiscard]] Eigen::Matrix3d inverse() const {
    Eigen::Matrix3d m;
    m << 1 / scale, 0, middle.x, 0, 1 / scale, middle.y, 0, 0, 1;
    return m;
  }
};

double length_of(Vec2 v) {
  return std::hypot(v.x, v.y);
}

}  // namespace

Vec2 map_through(const Homography& h, Vec2 p) {
  const double w = h[6] * p.x + h[7] * p.y + h[8];
  return {(h[0] * p.x + h[1] * p.y + h[2]) / w, (h[3] * p.x + h[4] * p.y + h[5]) / w};
}

std::optional<Homography> fit_homography(const std::vector<Sighting>& sightings) {
  if (sightings.size() < 4) return std::nullopt;
  const Normalizer camera(sightings, [](const Sighting& s) { return s.camera_px; });
  const Normalizer panel(sightings, [](const Sighting& s) { return s.panel_px; });
  Eigen::MatrixXd normal = Eigen::MatrixXd::Zero(9, 9);
  for (const Sighting& s : sightings) {
    const Vec2 a = camera.of(s.camera_px), b = panel.of(s.panel_px);
    Eigen::Matrix<double, 9, 1> row_x, row_y;
    row_x << a.x, a.y, 1, 0, 0, 0, -b.x * a.x, -b.x * a.y, -b.x;
    row_y << 0, 0, 0, a.x, a.y, 1, -b.y * a.x, -b.y * a.y, -b.y;
    normal += s.weight * (row_x * row_x.transpose() + row_y * row_y.transpose());
  }
  const SymmetricAxes axes = axes_of_symmetric(normal);
  // Two small eigenvalues mean that the points lie on a line.
  if (!(axes.values[1] > 1e-12 * axes.values[8])) return std::nullopt;
  const Eigen::VectorXd v = axes.vectors.col(0);
  Eigen::Matrix3d h;
  h << v[0], v[1], v[2], v[3], v[4], v[5], v[6], v[7], v[8];
  h = panel.inverse() * h * camera.matrix();
  Homography out{};
  for (int i = 0; i < 9; ++i) out[static_cast<size_t>(i)] = h(i / 3, i % 3);
  const bool finite = std::ranges::all_of(out, [](double x) { return std::isfinite(x); });
  return finite ? std::optional(out) : std::nullopt;
}

std::array<double, PanelMap::kTerms> PanelMap::terms(Vec2 camera_px) const {
  const Vec2 p = (camera_px - middle_) * scale_;
  std::array<double, kTerms> out{};
  size_t n = 0;
  double of_x = 1.0;
  for (int a = 0; a <= kDegree; ++a, of_x *= p.x) {
    double term = of_x;
    for (int b = 0; a + b <= kDegree; ++b, term *= p.y) out[n++] = term;
  }
  return out;
}

Vec2 PanelMap::at(Vec2 camera_px) const {
  Vec2 sum = map_through(homography_, camera_px);
  const std::array<double, kTerms> t = terms(camera_px);
  for (size_t n = 0; n < t.size(); ++n) sum = sum + polynomial_[n] * t[n];
  return sum;
}

std::vector<double> PanelMap::errors_of(const std::vector<Sighting>& sightings) const {
  std::vector<double> errors;
  errors.reserve(sightings.size());
  for (const Sighting& s : sightings) errors.push_back(length_of(at(s.camera_px) - s.panel_px));
  return errors;
}

bool PanelMap::fit_polynomial(const std::vector<Sighting>& sightings,
                              const std::vector<double>& errors) {
  Eigen::MatrixXd normal = Eigen::MatrixXd::Zero(kTerms, kTerms);
  Eigen::MatrixXd right = Eigen::MatrixXd::Zero(kTerms, 2);
  const double limit = kOutlier * std::max(typical_error_px_, 1e-6);
  for (size_t n = 0; n < sightings.size(); ++n) {
    if (errors[n] > limit) continue;
    const Sighting& s = sightings[n];
    const std::array<double, kTerms> t = terms(s.camera_px);
    const Eigen::Map<const Eigen::VectorXd> row(t.data(), kTerms);
    const Vec2 rest = s.panel_px - map_through(homography_, s.camera_px);
    normal += s.weight * row * row.transpose();
    right.col(0) += s.weight * rest.x * row;
    right.col(1) += s.weight * rest.y * row;
  }
  const Eigen::MatrixXd solution = solve_symmetric(normal, right);
  if (!solution.allFinite()) return false;
  for (int n = 0; n < kTerms; ++n)
    polynomial_[static_cast<size_t>(n)] = {solution(n, 0), solution(n, 1)};
  return true;
}

std::optional<PanelMap> PanelMap::fit(const std::vector<Sighting>& sightings) {
  if (sightings.size() < kFewestSightings) return std::nullopt;
  const Normalizer camera(sightings, [](const Sighting& s) { return s.camera_px; });
  PanelMap map;
  map.middle_ = camera.middle;
  map.scale_ = camera.scale;
  std::vector<Sighting> kept = sightings;
  for (int round = 0; round < kRounds; ++round) {
    const std::optional<Homography> h = fit_homography(kept);
    if (!h) return std::nullopt;
    map.homography_ = *h;
    map.polynomial_ = {};
    std::vector<double> errors = map.errors_of(kept);
    map.typical_error_px_ = upper_median(errors);
    if (!map.fit_polynomial(kept, errors)) return std::nullopt;
    errors = map.errors_of(sightings);
    map.typical_error_px_ = upper_median(errors);
    kept.clear();
    for (size_t n = 0; n < sightings.size(); ++n)
      if (errors[n] <= kOutlier * std::max(map.typical_error_px_, 1e-6))
        kept.push_back(sightings[n]);
    if (kept.size() < kFewestSightings) return std::nullopt;
  }
  return map;
}

}  // namespace lenticule::calib
