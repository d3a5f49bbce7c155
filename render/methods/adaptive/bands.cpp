// SPDX-License-Identifier: Apache-2.0
#include "render/methods/adaptive/bands.h"

#include <algorithm>

#include "base/error.h"

namespace lenticule::render {
namespace {

/// Distance of the bands of the step after the first.
constexpr int kSecond = 8;
/// Returns the distance of the first bands: few, but two if possible.
int first_stride(int bands) {
  return bands >= 8 * kSecond ? 4 * kSecond : 2 * kSecond;
}

}  // namespace

BandOrder::BandOrder(int bands)
    : gains_(static_cast<size_t>(bands)), decided_(gains_.size()), stride_(first_stride(bands)) {}

std::vector<int> BandOrder::next() {
  std::vector<int> due;
  const Sum all = sum();
  while (due.empty() && stride_ > 0) {
    const int first = is_first_ ? stride_ / 2 : 0;
    for (int band = first; band < static_cast<int>(gains_.size()); band += stride_) {
      uint8_t& decided = decided_[static_cast<size_t>(band)];
      if (decided == 0 && expected_gain(band, all) >= 0) due.push_back(band);
      decided = 1;
    }
    if (is_first_)
      stride_ = kSecond;
    else
      stride_ = all.gained == all.tried && stride_ > 1 ? 1 : stride_ / 2;
    is_first_ = false;
  }
  return due;
}

void BandOrder::note(int band, int64_t gain) {
  LENTICULE_CHECK(decided_[static_cast<size_t>(band)] != 0);
  gains_[static_cast<size_t>(band)] = gain;
}

BandOrder::Sum BandOrder::sum() const {
  Sum all;
  for (const std::optional<int64_t>& gain : gains_) {
    if (!gain) continue;
    all.total += *gain;
    ++all.tried;
    all.gained += *gain >= 0 ? 1 : 0;
  }
  return all;
}

bool BandOrder::loses() const {
  const Sum all = sum();
  return all.tried >= (all.gained == 0 ? 2 : 4) && all.total < 0;
}

/// Estimates four times the gain of a band: those of its neighbours, and twice the mean, which does
/// not make up for two neighbours that lose.
int64_t BandOrder::expected_gain(int band, const Sum& all) const {
  if (all.tried == 0) return 0;
  const int64_t mean = all.total / all.tried;
  const auto nearest = [&](int way) {
    for (int n = band; n >= 0 && n < static_cast<int>(gains_.size()); n += way)
      if (gains_[static_cast<size_t>(n)]) return *gains_[static_cast<size_t>(n)];
    return mean;
  };
  const int64_t above = nearest(-1), below = nearest(1);
  if (above < 0 && below < 0) return above + below;
  return above + below + 2 * mean;
}

namespace {

// Rough estimates from profiles of a few scenes, in nanoseconds; not fitted.
constexpr int64_t kPrimary = 45;     ///< method full: a ray that meets a surface, and its shading
constexpr int64_t kMaterial = 60;    ///< the same with a metallic-roughness material, some textured
constexpr int64_t kRay = 20;         ///< a shadow or secondary ray
constexpr int64_t kSubpixel = 10;    ///< row sweep and lookup
constexpr int64_t kCut = 90;         ///< a primitive cut by a row's plane
constexpr int64_t kSorting = 60;     ///< a subpixel that is shaded individually, without its rays
constexpr int64_t kPrimitive = 400;  ///< set-up for a frame
/// Subpixels with metallic-roughness materials: three channels are kept for each sample, and as
/// long as shading itself takes the sorting of those that are shaded individually.
constexpr int64_t kMaterialSubpixel = 20;
constexpr int64_t kMaterialSorting = 90;
/// Rays per subpixel with soft light, in sixteenths: always many.
constexpr int64_t kSoftRays = 16 * 100;

/// Costs of metallic-roughness materials, with the time of `full` for a subpixel that sees one.
BandCosts costs_of_materials(const BandCounts& band, int64_t full) {
  const int64_t seen = band.seen, shaded = band.shaded;
  return {.full = seen * full,
          .lookups = seen * kMaterialSubpixel + band.cuts * kCut,
          .shading = shaded * (kMaterialSorting + full / 2)};
}

}  // namespace

BandCosts BandCostModel::costs(const BandCounts& band) const {
  const int64_t rendered = std::max<int64_t>(static_cast<int64_t>(subpixels), 1);
  const int64_t rays =
      is_soft ? kSoftRays
              : static_cast<int64_t>(16 * band.rays) / std::max<int64_t>(band.audited, 1);
  // Subpixels that see nothing cost little with both methods.
  const int64_t seen = band.seen, shaded = band.shaded;
  const int64_t rays_of_seen = seen > 0 ? rays * rendered / seen : 0;
  if (has_pbr) return costs_of_materials(band, kMaterial + kRay * rays_of_seen / 16);
  const int64_t full = kPrimary + kRay * rays_of_seen / 16;
  const int64_t samples = seen * full / 8 + band.audited * full * seen / rendered;
  return {.full = seen * full,
          .lookups = seen * kSubpixel + band.cuts * kCut + samples,
          .shading = shaded * (kSorting + full * 5 / 8)};
}

int64_t time_of_full(int64_t subpixels, int64_t rays) {
  return subpixels * (kPrimary + kRay * rays / 16);
}

int64_t time_of_set_up(int64_t primitives) {
  return primitives * kPrimitive;
}

}  // namespace lenticule::render
