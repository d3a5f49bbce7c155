// SPDX-License-Identifier: Apache-2.0
#include "calib/photo/fringe_start.h"

#include <Eigen/Dense>
#include <algorithm>
#include <array>
#include <cmath>
#include <complex>
#include <cstdlib>
#include <unsupported/Eigen/FFT>
#include <vector>

#include "base/statistics.h"

namespace lenticule::calib {
namespace {

constexpr int kMostColumns = 512;
constexpr int kFewestColumns = 128;
constexpr int kRows = 128;
/// Fewer fringes than this count as uneven light.
constexpr int kLeastFringes = 8;
/// Largest error of the starting pitch, relative to the number of lenses.
constexpr double kMostMoreAcross = 0.12;
constexpr int kMostMoreDown = 56;
constexpr std::array<double, 4> kKinds = {1.0, -1.0, 2.0, -2.0};  ///< detunings

/// Returns the number of grid columns for which nearly every cell gets a pixel of the photograph:
/// holes would form a pattern of their own.
int columns_for(const FringeSamples& fringes, const optics::Panel& panel) {
  const double shape = double(panel.width_px) / panel.height_px;
  const double pixels_across = std::sqrt(static_cast<double>(fringes.samples.size()) * shape);
  return std::clamp(static_cast<int>(0.9 * pixels_across), kFewestColumns, kMostColumns);
}

/// Returns the mean light of a grid of positions, relative to the local mean; 0 in cells without a
/// sample.
Eigen::MatrixXd light_grid(const FringeSamples& fringes, const SinglePhotoChart& chart,
                           double detuning, int columns) {
  const size_t blocks = static_cast<size_t>(fringes.columns) * static_cast<size_t>(fringes.rows);
  std::vector<double> light(blocks), count(blocks);
  for (const FringeSample& sample : fringes.samples) {
    light[sample.block] += sample.light;
    count[sample.block] += 1.0;
  }
  Eigen::MatrixXd sum = Eigen::MatrixXd::Zero(kRows, columns), n = sum;
  const optics::Panel& panel = chart.start.panel;
  for (const FringeSample& sample : fringes.samples) {
    if (SinglePhotoChart::detuning(fringes.band_of(sample.block, chart.bands)) != detuning)
      continue;
    const int c = std::clamp(static_cast<int>(double{sample.panel_x_px} * columns / panel.width_px),
                             0, columns - 1);
    const int r = std::clamp(static_cast<int>(double{sample.panel_y_px} * kRows / panel.height_px),
                             0, kRows - 1);
    sum(r, c) += sample.light - light[sample.block] / count[sample.block];
    n(r, c) += 1.0;
  }
  return (n.array() > 0.0).select(sum.array() / n.array().max(1.0), 0.0);
}

/// Spectrum measures the strength of the fringes of one kind of band relative to chance level.
class Spectrum {
 public:
  explicit Spectrum(const Eigen::MatrixXd& light)
      : values_(light.rows(), light.cols()), columns_(static_cast<int>(light.cols())) {
    Eigen::FFT<double> fft;
    Eigen::VectorXcd in, line;
    for (int r = 0; r < kRows; ++r) {
      in = light.row(r).cast<std::complex<double>>();
      fft.fwd(line, in);
      values_.row(r) = line.transpose();
    }
    for (int c = 0; c < columns_; ++c) {
      in = values_.col(c);
      fft.fwd(line, in);
      values_.col(c) = line;
    }
    std::vector<double> sizes;
    for (int c = kLeastFringes; c < columns_ / 2; ++c)
      for (int r = 0; r < kRows; ++r) sizes.push_back(std::abs(values_(r, c)));
    usual_ = std::max(upper_median(std::move(sizes)), 1e-30);
  }

  /// Returns the strength; 1 is chance level, also for frequencies that the grid does not resolve
  /// and for those of uneven light.
  [[nodiscard]] double strength(int across, int down) const {
    const bool resolved = 2 * std::abs(across) < columns_ && 2 * std::abs(down) < kRows;
    if (!resolved || std::abs(across) < kLeastFringes) return 1.0;
    return std::abs(values_((down + kRows) % kRows, (across + columns_) % columns_)) / usual_;
  }

 private:
  Eigen::MatrixXcd values_;
  int columns_;
  double usual_ = 1.0;
};

}  // namespace

FringeCount count_fringes(const FringeSamples& fringes, const SinglePhotoChart& chart) {
  const optics::Panel& panel = chart.start.panel;
  const int columns = columns_for(fringes, panel);
  std::vector<Spectrum> spectra;
  for (const double kind : kKinds) spectra.emplace_back(light_grid(fringes, chart, kind, columns));
  const int across = chart.fringes;
  const int down = static_cast<int>(
      std::lround(across * chart.start.sheet.slant * panel.height_px / panel.width_px));
  const int most = static_cast<int>(kMostMoreAcross * plane_of(chart.start).across);
  FringeCount best;
  for (int y = -kMostMoreDown; y <= kMostMoreDown; ++y) {
    for (int x = -most; x <= most; ++x) {
      double product = 1.0;
      for (size_t k = 0; k < kKinds.size(); ++k) {
        const int kind = static_cast<int>(kKinds[k]);
        product *= spectra[k].strength(kind * across - x, kind * down - y);
      }
      const double prominence = std::pow(product, 1.0 / static_cast<double>(kKinds.size()));
      if (prominence <= best.prominence) continue;
      best = {{double(x), double(y)}, prominence};
    }
  }
  return best;
}

}  // namespace lenticule::calib
