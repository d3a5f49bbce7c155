// SPDX-License-Identifier: Apache-2.0
#include "calib/photo/phase_plane.h"

#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <complex>
#include <map>
#include <numbers>

#include "base/statistics.h"
#include "calib/linear_algebra.h"
#include "optics/residual_spline.h"

namespace lenticule::calib {
namespace {

constexpr int kPlaneTerms = 3;
constexpr int kPlaceTerms = 10;
constexpr int kTerms = kPlaneTerms + kPlaceTerms;
constexpr size_t kLeastBlocks = 20;
using Row = Eigen::Matrix<double, 1, kTerms>;
using Normal = Eigen::Matrix<double, kTerms, kTerms>;
using Terms = Eigen::Matrix<double, kTerms, 1>;

/// Returns the coefficients of one block. More lenses mean fewer fringes, so the plane's terms are
/// negative. The terms of position are the additional fringes of a position error, proportional to
/// the band's detuning.
Row row_of(const FringeBlock& block) {
  const double x = block.x, y = block.y, d = block.detuning;
  Row row;
  row << -1.0, -x, -y, d, d * x, d * y, d * x * x, d * x * y, d * y * y, d * x * x * x,
      d * x * x * y, d * x * y * y, d * y * y * y;
  return row;
}

/// Sums each kind of band separately, because a position error rotates them differently.
std::map<double, std::complex<double>> sums_of(const std::vector<FringeBlock>& blocks,
                                               double across, double down) {
  std::map<double, std::complex<double>> sums;
  for (const FringeBlock& b : blocks) {
    const double cycles = b.phase + across * b.x + down * b.y;
    sums[b.detuning] += std::polar(b.weight, 2.0 * std::numbers::pi * cycles);
  }
  return sums;
}

double score(const std::vector<FringeBlock>& blocks, double across, double down) {
  double strength = 0.0;
  for (const auto& [detuning, sum] : sums_of(blocks, across, down)) strength += std::abs(sum);
  return strength;
}

double wrapped(double cycles) {
  return cycles - std::round(cycles);
}

/// Returns the mean phase of all kinds of bands, each kind once. A position error moves the kinds
/// apart by less than half a cycle.
double mean_phase(const std::vector<FringeBlock>& blocks, const LensPlane& plane) {
  const auto sums = sums_of(blocks, plane.across, plane.down);
  if (sums.empty()) return 0.0;
  const auto cycles = [](const std::complex<double>& sum) {
    return std::arg(sum) / (2.0 * std::numbers::pi);
  };
  const double first = cycles(sums.begin()->second);
  double apart = 0.0;
  for (const auto& [detuning, sum] : sums) apart += wrapped(cycles(sum) - first);
  return first + apart / static_cast<double>(sums.size());
}

void refine(const std::vector<FringeBlock>& blocks, LensPlane& plane, double range, double step) {
  const LensPlane middle = plane;
  double best = -1.0;
  const int steps = static_cast<int>(std::lround(range / step));
  for (int j = -steps; j <= steps; ++j) {
    for (int i = -steps; i <= steps; ++i) {
      const double across = middle.across + i * step, down = middle.down + j * step;
      const double here = score(blocks, across, down);
      if (here <= best) continue;
      best = here;
      plane.across = across;
      plane.down = down;
    }
  }
}

/// Regression does steps of reweighted least squares.
class Regression {
 public:
  explicit Regression(const std::vector<FringeBlock>& blocks) : blocks_(blocks) {
    double sum = 0.0;
    for (const FringeBlock& b : blocks) sum += b.weight;
    for (const FringeBlock& b : blocks)
      weights_.push_back(b.weight * static_cast<double>(blocks.size()) / sum);
  }

  void step(double outlier_lenses) {
    normal_ = Normal::Zero();
    Terms right = Terms::Zero();
    for (size_t i = 0; i < blocks_.size(); ++i) {
      const double ratio = residual(i) / outlier_lenses;
      const double weight = weights_[i] / (1.0 + ratio * ratio);
      const Row row = row_of(blocks_[i]);
      normal_ += weight * row.transpose() * row;
      right += weight * residual(i) * row.transpose();
    }
    // Far weaker than a single block: only affects terms that no block determines.
    normal_.diagonal().array() += 1e-6;
    solution_ += solve_symmetric(normal_, right);
  }

  [[nodiscard]] double residual(size_t i) const {
    return wrapped(blocks_[i].phase - row_of(blocks_[i]).dot(solution_));
  }
  [[nodiscard]] double weight(size_t i) const { return weights_[i]; }
  [[nodiscard]] const Terms& solution() const { return solution_; }
  [[nodiscard]] Normal inverse() const { return inverse_of_symmetric(normal_); }

 private:
  const std::vector<FringeBlock>& blocks_;
  std::vector<double> weights_;
  Normal normal_ = Normal::Zero();
  Terms solution_ = Terms::Zero();
};

void summarize(const Regression& regression, PlaneCorrection& out) {
  // Four times the scatter of a normal distribution with this median.
  const double outlier = std::max(4.0 * 1.4826 * median_magnitude(out.residuals), 1e-4);
  double squares = 0.0, weights = 0.0;
  for (size_t i = 0; i < out.residuals.size(); ++i) {
    const double off = std::abs(out.residuals[i]);
    if (off > outlier) continue;
    ++out.used;
    squares += regression.weight(i) * off * off;
    weights += regression.weight(i);
    out.max_lenses = std::max(out.max_lenses, off);
  }
  out.rms_lenses = weights > 0.0 ? std::sqrt(squares / weights) : 0.0;
}

}  // namespace

LensPlane search_plane(const std::vector<FringeBlock>& blocks) {
  LensPlane plane;
  refine(blocks, plane, 1.6, 0.2);
  refine(blocks, plane, 0.2, 0.04);
  plane.at = -mean_phase(blocks, plane);
  return plane;
}

PlaneCorrection fit_plane(const std::vector<FringeBlock>& blocks) {
  PlaneCorrection out;
  out.residuals.assign(blocks.size(), 0.0);
  if (blocks.size() < kLeastBlocks) return out;
  constexpr double kOutlierLenses = 0.03;
  Regression regression(blocks);
  // The first steps use wide limits, so that with a start that is off by some tenths not all blocks
  // are outliers.
  for (const double wide : {10.0, 5.0, 3.0, 2.0, 1.0, 1.0, 1.0, 1.0, 1.0, 1.0})
    regression.step(wide * kOutlierLenses);
  for (size_t i = 0; i < blocks.size(); ++i) out.residuals[i] = regression.residual(i);
  summarize(regression, out);
  const Terms& solution = regression.solution();
  out.add = {solution[0], solution[1], solution[2]};
  const double freedom = std::max(out.used - kTerms, 1);
  const Normal covariance =
      regression.inverse() * (out.rms_lenses * out.rms_lenses * out.used / freedom);
  for (int r = 0; r < kPlaneTerms; ++r)
    for (int c = 0; c < kPlaneTerms; ++c)
      out.covariance[static_cast<size_t>(kPlaneTerms * r + c)] = covariance(r, c);
  return out;
}

namespace {

constexpr int kColumns = 13;
constexpr int kRows = 8;
constexpr size_t kLeastMapBlocks = 100;
// Relative to the panel's width and height: about the distance of knots.
constexpr double kReachX = 0.06;
constexpr double kReachY = 0.09;

/// Returns the value at (x, y) of the plane through the surrounding blocks.
double smoothed(const std::vector<FringeBlock>& blocks, const std::vector<double>& residuals,
                double x, double y) {
  constexpr double kOutlierLenses = 0.03;
  Eigen::Vector3d plane = Eigen::Vector3d::Zero();
  for (int round = 0; round < 5; ++round) {
    Eigen::Matrix3d normal = 1e-9 * Eigen::Matrix3d::Identity();
    Eigen::Vector3d right = Eigen::Vector3d::Zero();
    for (size_t i = 0; i < blocks.size(); ++i) {
      const Eigen::Vector3d terms(1.0, (blocks[i].x - x) / kReachX, (blocks[i].y - y) / kReachY);
      const double off = (-residuals[i] - terms.dot(plane)) / kOutlierLenses;
      const double near = std::exp(-0.5 * (terms[1] * terms[1] + terms[2] * terms[2]));
      // No outlier is known in the first round.
      const double weight = near / (1.0 + (round > 0 ? off * off : 0.0));
      normal += weight * terms * terms.transpose();
      right -= weight * residuals[i] * terms;
    }
    plane = solve_symmetric(normal, right);
  }
  return plane[0];
}

}  // namespace

optics::ResidualMap smooth_map(const std::vector<FringeBlock>& blocks,
                               const std::vector<double>& residuals) {
  if (blocks.size() < kLeastMapBlocks) return {};
  optics::ResidualMap map{kColumns, kRows, {}};
  for (int r = 0; r < kRows; ++r)
    for (int c = 0; c < kColumns; ++c)
      map.lenses.push_back(
          smoothed(blocks, residuals, c / (kColumns - 1.0) - 0.5, r / (kRows - 1.0) - 0.5));
  return map;
}

optics::ResidualMap sum_of_maps(const optics::ResidualMap& a, const optics::ResidualMap& b) {
  if (a.empty()) return b;
  if (b.empty()) return a;
  optics::ResidualMap sum{std::max(a.columns, b.columns), std::max(a.rows, b.rows), {}};
  // The maps are evaluated on a panel with as many pixels as there are steps between knots.
  const int width = std::max(sum.columns - 1, 1), height = std::max(sum.rows - 1, 1);
  const optics::ResidualSpline first(a, width, height), second(b, width, height);
  for (int r = 0; r < sum.rows; ++r)
    for (int c = 0; c < sum.columns; ++c)
      sum.lenses.push_back(first.at(c, r).lenses + second.at(c, r).lenses);
  return sum;
}

}  // namespace lenticule::calib
