// SPDX-License-Identifier: Apache-2.0
#include "render/methods/adaptive/band_costs.h"

#include <algorithm>

namespace lenticule::render {
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
