// SPDX-License-Identifier: Apache-2.0
// The panel of a FlatView has one lens per pixel, displaced for each channel to lie in front of its
// subpixel, and its pitch is such that each lens sends its pixel to one eye in the middle: seen
// from the eye at distance Z, a sheet with the gap g has the effective pitch P (1 + g/Z), which is
// made three subpixels. So all rays pass through that eye, as in a pinhole camera.
#include "apps/lenticule-tools/offline/thumbnail.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "frames/image_io.h"
#include "render/methods/method.h"
#include "render/scene/scene.h"

namespace lenticule::tools {
namespace {

constexpr int kPictureWidth = 480;
constexpr int kPictureHeight = 360;
/// Rays per pixel, along a row and along a column.
constexpr int kFiner = 2;
constexpr double kPixelMm = 0.25;
constexpr double kHeightMm = kPictureHeight * kFiner * kPixelMm;
/// Vertical field of view where the scene has no camera, degrees.
constexpr double kFieldOfView = 25.0;

optics::OpticalModel model_seen_from(double distance_mm) {
  constexpr double kGapMm = 1.0;
  optics::Rig rig;
  rig.name = "thumbnail";
  rig.panel.width_px = kPictureWidth * kFiner;
  rig.panel.height_px = kPictureHeight * kFiner;
  rig.panel.pixel_width = rig.panel.pixel_height = Millimetres(kPixelMm);
  const double narrower = 1.0 / (1.0 + kGapMm / distance_mm);
  rig.sheet.pitch = Subpixels(3.0 * narrower);
  rig.sheet.offset = Lenses(0.5);  // the panel's centre lies between two pixels
  rig.sheet.gap = Millimetres(kGapMm);
  rig.sheet.channel_offset = {Subpixels(narrower), Subpixels(0.0), Subpixels(-narrower)};
  rig.viewing.distance = Millimetres(distance_mm);
  return optics::OpticalModel(rig);
}

/// Returns the mean of kFiner x kFiner pixels for each pixel of the result.
frames::WovenFrame reduced(const frames::WovenFrame& fine) {
  frames::WovenFrame out({kPictureWidth, kPictureHeight, frames::PixelFormat::Rgb8});
  for (int j = 0; j < kPictureHeight; ++j)
    for (int i = 0; i < kPictureWidth; ++i)
      for (int c = 0; c < 3; ++c) {
        int sum = 0;
        for (int n = 0; n < kFiner * kFiner; ++n)
          sum += fine.row(kFiner * j + n / kFiner)[3 * (kFiner * i + n % kFiner) + c];
        out.row(j)[3 * i + c] = static_cast<uint8_t>((sum + kFiner * kFiner / 2) / kFiner / kFiner);
      }
  return out;
}

}  // namespace

FlatView make_flat_view(const render::SceneDescription& scene) {
  const bool camera = !scene.cameras.empty();
  const double angle =
      camera ? std::clamp(scene.cameras.front().vertical_fov_degrees, 0.5, 150.0) : kFieldOfView;
  const double distance_mm = kHeightMm / 2.0 / std::tan(angle / 2.0 * std::numbers::pi / 180.0);
  const optics::OpticalModel model = model_seen_from(distance_mm);
  render::StageOptions options{.depth_scale = 1.0, .fill = 0.8};
  render::Stage stage = render::make_stage(scene, model, options);
  // Without a camera, a scene deeper than wide could reach the eye.
  if (!camera && stage.near_mm > distance_mm / 2.0) {
    options.depth_scale = distance_mm / 2.0 / stage.near_mm;
    stage = render::make_stage(scene, model, options);
  }
  return {model, stage};
}

void write_thumbnail(const render::SceneDescription& description, const FlatView& view,
                     const std::filesystem::path& file) {
  const optics::Panel& panel = view.model.rig().panel;
  frames::WovenFrame fine({panel.width_px, panel.height_px, frames::PixelFormat::Rgb8});
  const render::Scene scene(description, view.stage, {});
  (void)render::make_method("full", view.model, {})->render(scene, view.stage, fine);
  frames::write_woven(reduced(fine).view(), file);
}

}  // namespace lenticule::tools
