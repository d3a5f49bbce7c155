// SPDX-License-Identifier: Apache-2.0
// Tests outlines of every slope, each exactly through the ray of a subpixel: method adaptive
// against full.
#include <fmt/format.h>

#include <atomic>
#include <cmath>
#include <numbers>

#include "apps/lenticule-bench/stability/rows.h"
#include "apps/lenticule-bench/stability/small_scenes.h"
#include "apps/lenticule-bench/stability/tally.h"
#include "player/process/interrupt.h"

namespace lenticule::bench {
namespace {

constexpr double kPaneMm = 12.0;   // distance in front of the panel
constexpr double kWallMm = -21.0;  // behind the panel
constexpr double kFarOff = 110.0;  // distance from the middle to beyond the visible area
constexpr double kError = 2.0;     // codes, the tolerated error of method adaptive

/// Surfaces are identified by ranges of codes, which light does not change.
enum class Seen { Wall, Pane, Nothing, Neither };
Seen seen(uint8_t code) {
  if (code <= 90) return Seen::Wall;
  if (code >= 140 && code <= 220) return Seen::Pane;
  return code >= 250 ? Seen::Nothing : Seen::Neither;
}

/// A line in the pane's plane.
struct Outline {
  Vec3 point;
  Vec3 along;   ///< unit
  Vec3 inward;  ///< unit, toward the pane
  [[nodiscard]] double distance(Vec3 p) const { return std::abs(dot(p - point, inward)); }
};

/// Returns the intersection of a subpixel's ray with the pane's plane.
Vec3 at_pane(const optics::SubpixelRay& ray) {
  return {ray.lens_x_mm + kPaneMm * ray.tan_x, ray.lens_y_mm + kPaneMm * ray.tan_y, kPaneMm};
}

Outline outline_at(const optics::OpticalModel& model, double degrees) {
  const double angle = degrees * std::numbers::pi / 180.0;
  // All components but one of a level line must be exactly zero.
  const auto clean = [](double v) { return std::abs(v) < 1e-15 ? 0.0 : v; };
  const double c = clean(std::cos(angle)), s = clean(std::sin(angle));
  const optics::Panel& panel = model.rig().panel;
  return {.point = at_pane(model.ray(panel.width_px / 2, panel.height_px / 2, 1)),
          .along = {c, s, 0.0},
          .inward = {-s, c, 0.0}};
}

/// Returns half a plane in front of a wall, with a light whose shadow has an edge of the same
/// slope.
render::SceneDescription scene_of(const Outline& outline) {
  render::SceneDescription scene = dark_scene({1.0, 1.0, 1.0});
  scene.source = "slopes";
  scene.materials = {
      render::Material{.name = "wall", .diffuse = 0.2, .emission = Vec3{0.1, 0.12, 0.14}},
      render::Material{.name = "pane", .diffuse = 0.2, .emission = Vec3{0.57, 0.59, 0.61}}};
  scene.meshes = {
      grid_mesh({-kFarOff, -kFarOff, kWallMm}, {2 * kFarOff, 0, 0}, {0, 2 * kFarOff, 0}, 1),
      grid_mesh(outline.point - outline.along * kFarOff, outline.along * (2 * kFarOff),
                outline.inward * kFarOff, 1)};
  scene.meshes[1].material = 1;
  render::Light light;
  light.position = {-57.0, 83.0, 310.0};
  scene.lights = {light};
  return scene;
}

/// Returns all angles in steps, and angles slightly beside those that are special to a panel.
std::vector<double> slopes(const optics::Rig& rig, double per_degree) {
  std::vector<double> degrees;
  for (int n = 0; n < 180.0 * per_degree; ++n) degrees.push_back(n / per_degree);
  const optics::Panel& panel = rig.panel;
  const double lean =
      std::atan(rig.sheet.slant * panel.pixel_width.value / panel.pixel_height.value) * 180.0 /
      std::numbers::pi;
  for (const double special : {0.0, 45.0, 90.0, 135.0, 90.0 + lean, 90.0 - lean})
    for (const double beside : {0.0, 1e-6, -1e-6}) degrees.push_back(special + beside);
  return degrees;
}

/// Counts subpixels whose error exceeds the tolerated one, and the number that the method reports
/// as its bound.
struct Beyond {
  std::atomic<uint64_t> subpixels{0};
  std::atomic<uint64_t> allowed{0};
  std::atomic<uint64_t> on_outline{0};
};

struct Pictures {
  SmallFrame full, adaptive;
};

Pictures pictures_of(const optics::OpticalModel& model, const Outline& outline) {
  const render::Stage stage = plain_stage();
  const render::Scene scene(scene_of(outline), stage, {}, 1);
  const render::RenderOptions options{
      .threads = 1, .tolerated_error = kError, .cancelled = player::interrupted};
  const auto make = [&](const char* name) {
    return next_frame(*render::make_method(name, model, options), scene, stage, model.rig());
  };
  return {make("full"), make("adaptive")};
}

Tally compare(const optics::OpticalModel& model, const Outline& outline, const Pictures& pictures,
              Beyond& beyond) {
  Tally tally;
  uint64_t off = 0;
  const optics::Panel& panel = model.rig().panel;
  for (int j = 0; j < panel.height_px; ++j)
    for (int s = 0; s < 3 * panel.width_px; ++s) {
      const uint8_t made = pictures.adaptive.frame.row(j)[s],
                    ground_truth = pictures.full.frame.row(j)[s];
      const Seen what = seen(made);
      tally.check(what == Seen::Wall || what == Seen::Pane);
      if (what == seen(ground_truth)) {
        if (std::abs(int{made} - int{ground_truth}) > kError) ++off;
        continue;
      }
      ++beyond.on_outline;
      tally.error(outline.distance(at_pane(model.ray(s / 3, j, s % 3))));
    }
  beyond.subpixels += off;
  const auto subpixels = static_cast<double>(pictures.full.frame.bytes().size());
  beyond.allowed += static_cast<uint64_t>(pictures.adaptive.statistics.beyond_bound * subpixels);
  return tally;
}

}  // namespace

StabilityRow stability_outline_slopes(const StabilitySize& size) {
  const optics::OpticalModel model(finer(small_rig(), size.full ? 2 : 1));
  const std::vector<double> degrees = slopes(model.rig(), size.full ? 10.0 : 0.5);
  SharedTally shared;
  Beyond beyond;
  for_each_part(size, degrees.size(), [&](uint64_t k) {
    const Outline outline = outline_at(model, degrees[k]);
    const Pictures pictures = pictures_of(model, outline);
    if (!player::interrupted()) shared.add(compare(model, outline, pictures, beyond));
  });
  // The row sweep's tolerance for points on an outline, docs/render/row-sweep.md: 4e-7 of
  // coordinates.
  const double coordinates = std::hypot(kFarOff, kFarOff);
  StabilityRow row{
      .stressed = "outlines at every slope through a subpixel's ray, adaptive against full",
      .samples = shared.sum().samples,
      .samples_are = "subpixels",
      .failures = shared.sum().failures,
      .failures_are = "show no surface",
      .worst = shared.sum().worst,
      .bound = 4e-7 * coordinates,
      .unit = "mm off the outline",
      .note = fmt::format("{} outlines, {} subpixels on them; {} off by more than {} codes, at "
                          "most {} according to the frames",
                          degrees.size(), beyond.on_outline.load(), beyond.subpixels.load(), kError,
                          beyond.allowed.load())};
  if (beyond.subpixels > beyond.allowed) ++row.failures;
  return row;
}

}  // namespace lenticule::bench
