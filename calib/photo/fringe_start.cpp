// SPDX-License-Identifier: Apache-2.0
#include "calib/photo/fringe_start.h"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <complex>
#include <cstdlib>
#include <unsupported/Eigen/FFT>
#include <vector>

namespace lenticule::calib {
namespace {

constexpr int kColumns = 256;
constexpr int kRows = 128;
/// Fewer fringes than these are taken for uneven light.
constexpr int kLeastFringes = 8;
constexpr int kMostMoreAcross = 48;
constexpr int kMostMoreDown = 56;

using Spectrum = Eigen::MatrixXcd;

/// Mean light of a grid of places, 0 being the mean around them; 0 where there is no sample.
Eigen::MatrixXd light_grid(const FringeSamples& fringes, const SinglePhotoChart& chart,
                           double direction) {
  const size_t blocks = static_cast<size_t>(fringes.columns) * static_cast<size_t>(fringes.rows);
  std::vector<double> light(blocks), count(blocks);
  for (const FringeSample& sample : fringes.samples) {
    light[sample.block] += sample.light;
    count[sample.block] += 1.0;
  }
  Eigen::MatrixXd sum = Eigen::MatrixXd::Zero(kRows, kColumns), n = sum;
  const optics::Panel& panel = chart.start.panel;
  for (const FringeSample& sample : fringes.samples) {
    if (SinglePhotoChart::direction(fringes.band_of(sample.block, chart.bands)) != direction)
      continue;
    const int c = std::clamp(
        static_cast<int>(double{sample.panel_x_px} * kColumns / panel.width_px), 0, kColumns - 1);
    const int r = std::clamp(static_cast<int>(double{sample.panel_y_px} * kRows / panel.height_px),
                             0, kRows - 1);
    sum(r, c) += sample.light - light[sample.block] / count[sample.block];
    n(r, c) += 1.0;
  }
  return (n.array() > 0.0).select(sum.array() / n.array().max(1.0), 0.0);
}

Spectrum spectrum_of(const Eigen::MatrixXd& light) {
  Eigen::FFT<double> fft;
  Spectrum out(kRows, kColumns);
  Eigen::VectorXcd in, line;
  for (int r = 0; r < kRows; ++r) {
    in = light.row(r).cast<std::complex<double>>();
    fft.fwd(line, in);
    out.row(r) = line.transpose();
  }
  for (int c = 0; c < kColumns; ++c) {
    in = out.col(c);
    fft.fwd(line, in);
    out.col(c) = line;
  }
  return out;
}

/// Strength at so many cycles across and down the panel; nothing beyond what the grid resolves and
/// where uneven light lives.
double strength(const Spectrum& spectrum, int across, int down) {
  const bool resolved = 2 * std::abs(across) < kColumns && 2 * std::abs(down) < kRows;
  if (!resolved || std::abs(across) < kLeastFringes) return 0.0;
  return std::abs(spectrum((down + kRows) % kRows, (across + kColumns) % kColumns));
}

}  // namespace

FringeCount count_fringes(const FringeSamples& fringes, const SinglePhotoChart& chart) {
  const Spectrum forward = spectrum_of(light_grid(fringes, chart, 1.0));
  const Spectrum backward = spectrum_of(light_grid(fringes, chart, -1.0));
  const optics::Panel& panel = chart.start.panel;
  const int across = chart.fringes;
  const int down = static_cast<int>(
      std::lround(across * chart.start.sheet.slant * panel.height_px / panel.width_px));
  FringeCount best;
  double best_score = 0.0;
  std::vector<double> scores;
  for (int y = -kMostMoreDown; y <= kMostMoreDown; ++y) {
    for (int x = -kMostMoreAcross; x <= kMostMoreAcross; ++x) {
      const double score =
          strength(forward, across - x, down - y) * strength(backward, -across - x, -down - y);
      scores.push_back(score);
      if (score <= best_score) continue;
      best_score = score;
      best.more_lenses = {double(x), double(y)};
    }
  }
  const auto middle = scores.begin() + static_cast<ptrdiff_t>(scores.size() / 2);
  std::nth_element(scores.begin(), middle, scores.end());
  best.prominence = best_score / std::max(*middle, 1e-30);
  return best;
}

}  // namespace lenticule::calib
