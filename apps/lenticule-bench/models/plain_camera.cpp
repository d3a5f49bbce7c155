// SPDX-License-Identifier: Apache-2.0
// Without refraction an eye at distance Z sees the pixel at x through the point x Z / (Z + g) of
// the sheet, where g is the gap (docs/panel/optics.md). A pitch of 3 Z / (Z + g) subpixels
// therefore gives every pixel a lens of its own, with the pixel's centre on the line from the eye
// through the apex.
#include "apps/lenticule-bench/models/plain_camera.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "base/error.h"

namespace lenticule::bench {
namespace {

constexpr double kPixelMm = 0.1;
/// Gap relative to the panel's height. The picture does not depend on it.
constexpr double kGap = 1e-3;
/// Azimuth to the right and elevation of framing_camera().
constexpr double kAzimuthDegrees = 30.0;
constexpr double kElevationDegrees = 20.0;
/// Fraction of the picture's width or height that the bounds fill.
constexpr double kFill = 0.92;

double radians(double degrees) {
  return degrees * std::numbers::pi / 180.0;
}

}  // namespace

optics::Rig plain_camera_rig(int side_px, double vertical_fov_degrees) {
  const double height_mm = side_px * kPixelMm;
  const double gap_mm = kGap * height_mm;
  const double distance_mm = height_mm / 2.0 / std::tan(radians(vertical_fov_degrees / 2.0));
  optics::Rig rig;
  rig.name = "plain camera";
  rig.panel.width_px = side_px;
  rig.panel.height_px = side_px;
  rig.panel.pixel_width = Millimetres(kPixelMm);
  rig.panel.pixel_height = Millimetres(kPixelMm);
  rig.panel.layout = optics::SubpixelLayout::cells(1, 1, {optics::PixelCell{}});
  rig.viewing.distance = Millimetres(distance_mm - gap_mm);
  rig.sheet.gap = Millimetres(gap_mm);
  rig.sheet.pitch = Subpixels(3.0 * (distance_mm - gap_mm) / distance_mm);
  // Phases of pixel centres are whole numbers.
  rig.sheet.offset = Lenses(side_px % 2 == 0 ? 0.5 : 0.0);
  return rig;
}

Vec3 toward_framing_camera() {
  const double azimuth = radians(kAzimuthDegrees);
  const double elevation = radians(kElevationDegrees);
  return {std::sin(azimuth) * std::cos(elevation), std::sin(elevation),
          std::cos(azimuth) * std::cos(elevation)};
}

Vec3 environment_ahead() {
  const Vec3 toward = toward_framing_camera();
  return normalized(Vec3{-toward.x, 0, -toward.z});
}

render::Camera framing_camera(const render::SceneDescription& scene) {
  const render::Bounds bounds = render::scene_bounds(scene);
  const Vec3 toward = toward_framing_camera();
  const Vec3 right = normalized(cross(Vec3{0, 1, 0}, toward));
  const Vec3 up = cross(toward, right);
  const Vec3 centre = (bounds.low + bounds.high) * 0.5;
  const double tangent = kFill * std::tan(radians(kModelFovDegrees / 2.0));
  double distance = 0.0;
  for (const render::TriangleMesh& mesh : scene.meshes)
    for (const auto& triangle : mesh.triangles)
      for (const uint32_t corner : triangle) {
        const Vec3 p = mesh.positions[corner] - centre;
        const double aside = std::max(std::abs(dot(p, right)), std::abs(dot(p, up)));
        distance = std::max(distance, dot(p, toward) + aside / tangent);
      }
  if (!(distance > 0.0))
    throw Error(ErrorKind::Input, scene.source + ": the scene has no extent to be shown");
  return {.from = centre + toward * distance,
          .at = centre,
          .up = {0, 1, 0},
          .vertical_fov_degrees = kModelFovDegrees};
}

render::StageOptions plain_camera_stage(const render::Camera& camera, const optics::Rig& rig) {
  render::StageOptions options;
  options.centre = camera.at;
  options.mm_per_unit = rig.viewing.distance.value / length(camera.from - camera.at);
  options.depth_scale = 1.0;
  return options;
}

}  // namespace lenticule::bench
