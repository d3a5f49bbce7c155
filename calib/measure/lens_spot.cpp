// SPDX-License-Identifier: Apache-2.0
#include "calib/measure/lens_spot.h"

#include <algorithm>
#include <cmath>
#include <numeric>

namespace lenticule::calib {
namespace {

/// Returns the profile's standard deviation about its middle, above its floor.
double sigma_of(const std::vector<double>& profile, double floor) {
  const auto bins = static_cast<double>(profile.size());
  double sum = 0.0, square = 0.0;
  for (size_t b = 0; b < profile.size(); ++b) {
    const double place = (static_cast<double>(b) + 0.5) / bins - 0.5;
    const double light = std::max(0.0, profile[b] - floor);
    sum += light;
    square += light * place * place;
  }
  // The comb itself is one bin wide.
  const double comb = 1.0 / (12.0 * bins * bins);
  return sum > 0.0 ? std::sqrt(std::max(square / sum - comb, 0.25 * comb)) : 0.0;
}

/// Returns the crosstalk for an eye in the middle of one of two views: the light of the other view
/// divided by the light of its own.
double two_view_crosstalk(const std::vector<double>& profile) {
  const size_t bins = profile.size();
  double own = 0.0, other = 0.0;
  for (size_t b = 0; b < bins; ++b) {
    const double place = (static_cast<double>(b) + 0.5) / static_cast<double>(bins) - 0.5;
    (std::abs(place) < 0.25 ? own : other) += profile[b];
  }
  return own > 0.0 ? other / own : 1.0;
}

}  // namespace

SpotSum::SpotSum(int bins, const BlockGrid& blocks, const LinearPhase& drawn,
                 const optics::Panel& panel)
    : blocks_(blocks), profile_(static_cast<size_t>(bins)) {
  for (const PhaseBlock& block : blocks.blocks)
    shifts_.push_back((block.phase - drawn.at(block.panel_px, panel)) * bins);
}

void SpotSum::add(int bin, const GreyPicture& picture, const GreyPicture& dark,
                  const std::vector<uint32_t>& pixels, int block_px) {
  const auto bins = static_cast<int>(profile_.size());
  for (const uint32_t pixel : pixels) {
    const int x = static_cast<int>(pixel) % picture.width / block_px;
    const int y = static_cast<int>(pixel) / picture.width / block_px;
    const auto n = static_cast<size_t>(y * blocks_.columns + x);
    if (blocks_.blocks[n].pixels == 0) continue;
    // A block whose phase is larger than the drawn one shows this bin at a larger place.
    const double at = bin + shifts_[n];
    const double whole = std::floor(at);
    const double light = double{picture.light[pixel]} - double{dark.light[pixel]};
    const int first = ((static_cast<int>(whole) % bins) + bins) % bins;
    profile_[static_cast<size_t>(first)] += light * (1.0 - (at - whole));
    profile_[static_cast<size_t>((first + 1) % bins)] += light * (at - whole);
  }
}

LensSpot SpotSum::result() const {
  LensSpot spot;
  const double all = std::accumulate(profile_.begin(), profile_.end(), 0.0);
  if (!(all > 0.0)) return spot;
  for (const double light : profile_) spot.profile.push_back(light / all);
  const double floor = std::max(0.0, *std::min_element(spot.profile.begin(), spot.profile.end()));
  spot.veiling_glare = floor * static_cast<double>(spot.profile.size());
  spot.sigma_lenses = sigma_of(spot.profile, floor);
  spot.two_view_crosstalk = two_view_crosstalk(spot.profile);
  return spot;
}

}  // namespace lenticule::calib
