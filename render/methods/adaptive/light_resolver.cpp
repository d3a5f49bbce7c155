// SPDX-License-Identifier: Apache-2.0
#include "render/methods/adaptive/light_resolver.h"

#include <algorithm>
#include <cmath>

namespace lenticule::render {
namespace {

/// Returns the difference on a perceptual scale: encoding is approximately the square root of
/// linear light.
float apart(float low, float high, bool colour_managed) {
  return colour_managed ? std::sqrt(std::max(high, 0.0F)) - std::sqrt(std::max(low, 0.0F))
                        : high - low;
}

constexpr int kFinerParts =
    ResolvedAreaLights::kWholeAreaLight / KeySamples::Light::kWholeAreaLight;

}  // namespace

LightResolver::LightResolver(const KeySamples& samples, const KeyGrid& grid,
                             const Agreement& agreement, bool colour_managed, const SoftLight& soft)
    : samples_(samples),
      grid_(grid),
      agreement_(agreement),
      colour_managed_(colour_managed),
      finds_around_(soft.samples_ambient()),
      finds_area_lights_(soft.shadow_samples > 0),
      remembered_(grid.row_samples()),
      remembered_area_lights_(finds_area_lights_ ? grid.row_samples() : 0) {}

void LightResolver::AreaLights::add(const KeySamples::Light& light) {
  for (size_t n = 0; n < least.size(); ++n) {
    if (light.seen[n] == KeySamples::Light::kNotShining) continue;
    ++count[n];
    least[n] = std::min(least[n], light.seen[n]);
    most[n] = std::max(most[n], light.seen[n]);
  }
}

void LightResolver::AreaLights::add(const AreaLights& other) {
  for (size_t n = 0; n < least.size(); ++n) {
    count[n] = static_cast<uint8_t>(count[n] + other.count[n]);
    least[n] = std::min(least[n], other.least[n]);
    most[n] = std::max(most[n], other.most[n]);
  }
}

void LightResolver::Corners::add(const KeySamples::Light& light) {
  add(Corners{.count = 1,
              .way = light.secondary_way,
              .lit = light.lit,
              .hidden = light.hidden,
              .low = light.secondary,
              .high = light.secondary,
              .least_around = light.around,
              .most_around = light.around});
}

/// Merges the corners of another cell with the same surface.
void LightResolver::Corners::add(const Corners& other) {
  if (other.count == 0) return;
  if (count == 0) way = other.way;
  same_way = same_way && other.same_way && way == other.way;
  count += other.count;
  lit &= other.lit;
  hidden &= other.hidden;
  for (size_t c = 0; c < 3; ++c) {
    low[c] = std::min(low[c], other.low[c]);
    high[c] = std::max(high[c], other.high[c]);
  }
  least_around = std::min(least_around, other.least_around);
  most_around = std::max(most_around, other.most_around);
}

template <class Use>
void LightResolver::each_corner(const Point& point, const Place& place, const Use& use) const {
  const float of_row_below = point.rows.part[place.odd];
  const size_t above = static_cast<size_t>(point.rows.above[place.odd]) * samples_.row_samples() +
                       static_cast<size_t>(place.cell);
  for (int corner = 0; corner < 4; ++corner) {
    const bool below = corner >= 2, next = corner % 2 != 0;
    const size_t at = above + (below ? samples_.row_samples() : 0) + (next ? 1 : 0);
    if (samples_.group(at) != point.group) continue;
    use(at, (below ? of_row_below : 1.0F - of_row_below) * (next ? place.part : 1.0F - place.part));
  }
}

const LightResolver::Corners& LightResolver::corners_of(const Point& point, const Place& place) {
  Corners& corners = remembered_[static_cast<size_t>(place.cell)];
  const int row = point.rows.above[place.odd];
  if (corners.row == row && corners.group == point.group) return corners;
  corners = {.group = point.group, .row = row};
  each_corner(point, place, [&](size_t at, float) { corners.add(samples_.light(at)); });
  if (finds_area_lights_) {
    AreaLights& area_lights = remembered_area_lights_[static_cast<size_t>(place.cell)];
    area_lights = {};
    each_corner(point, place, [&](size_t at, float) { area_lights.add(samples_.light(at)); });
  }
  return corners;
}

/// Resolves area lights for cells that corners_of() has computed. An area light that shines on only
/// a few corners contributes little and is left unresolved.
ResolvedAreaLights LightResolver::resolve_area_lights(const Point& point,
                                                      ResolvedLight& out) const {
  constexpr int kFew = 2;
  const auto most = static_cast<int>(agreement_.seen * KeySamples::Light::kWholeAreaLight);
  AreaLights area_lights;
  for (const Place& place : point.places)
    if (place.cell >= 0) area_lights.add(remembered_area_lights_[static_cast<size_t>(place.cell)]);
  ResolvedAreaLights resolved;
  for (size_t n = 0; n < area_lights.count.size(); ++n) {
    const int apart = area_lights.most[n] - area_lights.least[n];
    const bool known = area_lights.count[n] >= kFew && apart <= most;
    if (known) out.area_lights_known = static_cast<uint8_t>(out.area_lights_known | 1U << n);
    if (known) resolved.apart[n] = static_cast<uint16_t>(apart * kFinerParts);
    const bool wanted = !known && area_lights.count[n] > 0;
    if (wanted && out.wanted == ResolvedLight::kNoSamples) out.wanted = static_cast<uint8_t>(n);
  }
  if (out.area_lights_known != 0) blend_area_lights(point, resolved);
  return resolved;
}

namespace {

constexpr float kLittle = 1e-3F;  // a minimum, so that no corner has weight zero

}  // namespace

/// Computes the means of the corners, even those that are not used.
void LightResolver::blend(const Point& point, ResolvedLight& out) const {
  const auto channel = static_cast<size_t>(point.channel);
  float secondary = 0.0F, around = 0.0F, weights = 0.0F;
  for (const Place& place : point.places) {
    if (place.cell < 0) continue;
    each_corner(point, place, [&](size_t at, float in_cell) {
      const float weight = place.weight * in_cell + kLittle;
      secondary += weight * samples_.light(at).secondary[channel];
      around += weight * samples_.light(at).around;
      weights += weight;
    });
  }
  out.secondary = secondary / weights;
  out.around = around / weights;
}

/// Computes the means of the area lights' shares over the corners on which they shine.
void LightResolver::blend_area_lights(const Point& point, ResolvedAreaLights& out) const {
  std::array<float, LightNotes::kAreaLights> seen{}, weights{};
  for (const Place& place : point.places) {
    if (place.cell < 0) continue;
    each_corner(point, place, [&](size_t at, float in_cell) {
      const float weight = place.weight * in_cell + kLittle;
      const KeySamples::Light& light = samples_.light(at);
      for (size_t n = 0; n < seen.size(); ++n) {
        const bool shines = light.seen[n] != KeySamples::Light::kNotShining;
        seen[n] += shines ? weight * static_cast<float>(light.seen[n]) : 0.0F;
        weights[n] += shines ? weight : 0.0F;
      }
    });
  }
  for (size_t n = 0; n < seen.size(); ++n)
    if (weights[n] > 0.0F)
      out.seen[n] = static_cast<uint16_t>(seen[n] / weights[n] * kFinerParts + 0.5F);
}

bool LightResolver::is_as_before(const KeyGrid::Between& rows,
                                 const std::array<Place, 2>& places) const {
  return std::ranges::none_of(places, [&](const Place& place) {
    return place.cell >= 0 &&
           samples_.cell_changed(rows.above[place.odd], static_cast<size_t>(place.cell));
  });
}

void LightResolver::resolve(const Point& point, ResolvedLight& out,
                            std::vector<ResolvedAreaLights>& area_lights) {
  Corners corners{.group = point.group};
  float weight_of_pictures = 0.0F;  // total weight of the views that show the surface
  for (const Place& place : point.places) {
    if (place.cell < 0) continue;
    const Corners& of_cell = corners_of(point, place);
    if (of_cell.count > 0) weight_of_pictures += place.weight;
    corners.add(of_cell);
  }
  constexpr int kFewCorners = 3;
  out = {};
  if (finds_around_ || finds_area_lights_) out.wanted = ResolvedLight::kAllSamples;
  if (corners.count < kFewCorners) return;
  out.lit = corners.lit;
  out.hidden = corners.hidden;
  const float most = corners.same_way ? agreement_.secondary : 0.5F * agreement_.secondary;
  const auto channel = static_cast<size_t>(point.channel);
  const float low = corners.low[channel], high = corners.high[channel];
  // Reflections differ between viewing places.
  const bool from_near = weight_of_pictures >= 1.0F - grid_.lookup().near;
  out.secondary_known = from_near && apart(low, high, colour_managed_) <= most;
  out.around_known = finds_around_ && corners.least_around >= 0.0F &&
                     corners.most_around - corners.least_around <= agreement_.around;
  if (out.around_known || !finds_around_) out.wanted = ResolvedLight::kNoSamples;
  if (finds_area_lights_) {
    const ResolvedAreaLights resolved = resolve_area_lights(point, out);
    out.area_lights = static_cast<uint32_t>(area_lights.size());
    if (out.area_lights_known != 0) area_lights.push_back(resolved);
  }
  const bool dark = low == 0.0F && high == 0.0F;
  if (out.around_known || (out.secondary_known && !dark)) blend(point, out);
}

}  // namespace lenticule::render
