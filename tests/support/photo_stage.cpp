// SPDX-License-Identifier: Apache-2.0
#include "tests/support/photo_stage.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <random>

#include "frames/srgb.h"
#include "optics/model.h"

namespace lenticule::test {
namespace {

/// LitPanel gives the light of a row of subpixels around a place, weighted by the spot of the lens.
class LitPanel {
 public:
  LitPanel(const optics::Rig& rig, const frames::WovenFrame& shown)
      : rig_(rig),
        shown_(shown),
        sigma_subpx_(rig.sheet.spot_sigma.value * rig.sheet.pitch.value) {}

  [[nodiscard]] double light(Vec2 at) const {
    const optics::Panel& panel = rig_.panel;
    const int j = static_cast<int>(std::floor(at.y));
    if (at.x < 0 || at.x >= panel.width_px || j < 0 || j >= panel.height_px) return 0.0;
    const double middle = 3.0 * at.x - 0.5;  // subpixel k has its centre at k
    const int reach = static_cast<int>(std::ceil(3.0 * sigma_subpx_));
    double sum = 0.0, weights = 0.0;
    for (int k = static_cast<int>(std::lround(middle)) - reach; k <= std::lround(middle) + reach;
         ++k) {
      if (k < 0 || k >= 3 * panel.width_px) continue;
      const double off = (k - middle) / sigma_subpx_;
      const double weight = std::exp(-0.5 * off * off);
      sum += weight * frames::linear_of_codes()[shown_.row(j)[k]];
      weights += weight;
    }
    return weights > 0.0 ? sum / weights : 0.0;
  }

 private:
  const optics::Rig& rig_;
  const frames::WovenFrame& shown_;
  double sigma_subpx_;
};

/// Directions gives the direction of a picture point in the panel's frame.
class Directions {
 public:
  explicit Directions(const PhotoStage& stage) : stage_(stage) {}

  [[nodiscard]] Vec3 of(double column, double row) const {
    const double u = (column - 0.5 * stage_.width) / stage_.focal_px;
    const double v = -(row - 0.5 * stage_.height) / stage_.focal_px;
    const double stretch = 1.0 + stage_.distortion * (u * u + v * v);
    const double x = stretch * (u * cos_roll_ - v * sin_roll_);
    const double y = stretch * (u * sin_roll_ + v * cos_roll_);
    return {x * cos_yaw_ - sin_yaw_, y, -x * sin_yaw_ - cos_yaw_};
  }

 private:
  static constexpr double kDegree = std::numbers::pi / 180.0;
  const PhotoStage& stage_;
  const double cos_roll_ = std::cos(stage_.roll_degrees * kDegree);
  const double sin_roll_ = std::sin(stage_.roll_degrees * kDegree);
  const double cos_yaw_ = std::cos(stage_.yaw_degrees * kDegree);
  const double sin_yaw_ = std::sin(stage_.yaw_degrees * kDegree);
};

/// Returns the light of a ray: finds the lens that the ray meets, then the place that the eye sees
/// under that lens.
double light_along(const PhotoStage& stage, const optics::OpticalModel& model,
                   const LitPanel& panel_light, Vec3 direction) {
  const Vec3 at = stage.eye_mm + direction * (-stage.eye_mm.z / direction.z);
  const optics::Panel& panel = stage.rig.panel;
  const double x_px = panel.x_px(at.x), y_px = panel.y_px(at.y);
  if (x_px < 0 || x_px >= panel.width_px || y_px < 0 || y_px >= panel.height_px) return 0.0;
  const double lens = model.lens_coordinate(x_px, y_px, 1);
  // The apex line beside the ray, in the same row.
  const double apex_px = x_px + (std::round(lens) - lens) * stage.rig.sheet.pitch.value / 3.0;
  const Vec2 apex{panel.x_mm(apex_px), at.y};
  const Vec2 seen =
      apex - model.refraction_shift_mm(apex, {stage.eye_mm.x, stage.eye_mm.y, stage.eye_mm.z});
  return panel_light.light({panel.x_px(seen.x), panel.y_px(seen.y)});
}

float pixel_light(const PhotoStage& stage, const Directions& directions,
                  const optics::OpticalModel& model, const LitPanel& panel_light, int i, int j) {
  double sum = 0.0;
  const int side = stage.rays_per_side;
  for (int k = 0; k < side * side; ++k)
    sum += light_along(stage, model, panel_light,
                       directions.of(i + (k % side + 0.5) / side, j + (k / side + 0.5) / side));
  return static_cast<float>(stage.ambient + stage.gain * sum / (side * side));
}

/// Replaces values by the running mean over 2 reach + 1 of them, with the given step between them.
void blur_line(float* first, size_t step, int count, int reach) {
  std::vector<float> line;
  for (int i = 0; i < count; ++i) line.push_back(first[static_cast<size_t>(i) * step]);
  for (int i = 0; i < count; ++i) {
    float sum = 0.0F;
    for (int k = -reach; k <= reach; ++k)
      sum += line[static_cast<size_t>(std::clamp(i + k, 0, count - 1))];
    first[static_cast<size_t>(i) * step] = sum / static_cast<float>(2 * reach + 1);
  }
}

void blur(calib::CameraPicture& picture, int reach) {
  const auto width = static_cast<size_t>(picture.width);
  for (int pass = 0; pass < 2; ++pass) {
    for (int j = 0; j < picture.height; ++j)
      blur_line(&picture.light[static_cast<size_t>(j) * width], 1, picture.width, reach);
    for (int i = 0; i < picture.width; ++i)
      blur_line(&picture.light[static_cast<size_t>(i)], width, picture.height, reach);
  }
}

void expose(const PhotoStage& stage, calib::CameraPicture& picture) {
  std::mt19937 random(stage.seed);
  std::normal_distribution<double> noise(0.0, 1.0);
  for (float& light : picture.light) {
    const double noisy = std::clamp(light + stage.noise * noise(random), 0.0, 1.0);
    light = static_cast<float>(
        stage.eight_bits ? frames::linear_of_codes()[frames::code_from_linear(noisy)] : noisy);
  }
}

}  // namespace

optics::Rig desk_rig() {
  optics::Rig rig;
  rig.name = "desk";
  rig.panel.width_px = 3840;
  rig.panel.height_px = 2160;
  rig.panel.pixel_width = rig.panel.pixel_height = Millimetres(0.15565);
  rig.sheet.pitch = Subpixels(7.70123);
  rig.sheet.slant = 0.2521;
  rig.sheet.offset = Lenses(0.31);
  rig.sheet.gap = Millimetres(2.2);
  rig.sheet.refraction_shape = 1.0 / (1.5 * 1.5);
  rig.sheet.spot_sigma = Lenses(0.1);
  rig.viewing.distance = Millimetres(700.0);
  return rig;
}

calib::CameraPicture photograph(const PhotoStage& stage, const frames::WovenFrame& shown) {
  const optics::OpticalModel model(stage.rig);
  const LitPanel panel_light(stage.rig, shown);
  const Directions directions(stage);
  calib::CameraPicture picture;
  picture.width = stage.width;
  picture.height = stage.height;
  picture.channels = 1;
  for (int j = 0; j < stage.height; ++j)
    for (int i = 0; i < stage.width; ++i)
      picture.light.push_back(pixel_light(stage, directions, model, panel_light, i, j));
  if (stage.blur_px > 0) blur(picture, stage.blur_px);
  expose(stage, picture);
  return picture;
}

frames::WovenFrame scaled(const frames::WovenFrame& frame, double part) {
  frames::WovenFrame out(frame.geometry());
  const double left = 0.5 * (1.0 - part) * frame.width(), top = 0.5 * (1.0 - part) * frame.height();
  for (int j = 0; j < frame.height(); ++j)
    for (int i = 0; i < frame.width(); ++i) {
      const double x = (i + 0.5 - left) / part - 0.5, y = (j + 0.5 - top) / part - 0.5;
      if (x < 0.0 || y < 0.0 || x >= frame.width() - 1 || y >= frame.height() - 1) continue;
      const int x0 = static_cast<int>(x), y0 = static_cast<int>(y);
      for (int c = 0; c < 3; ++c) {
        const auto at = [&](int column, int row) {
          return double{static_cast<double>(frame.row(row)[3 * column + c])};
        };
        const double upper = at(x0, y0) + (x - x0) * (at(x0 + 1, y0) - at(x0, y0));
        const double lower = at(x0, y0 + 1) + (x - x0) * (at(x0 + 1, y0 + 1) - at(x0, y0 + 1));
        out.row(j)[3 * i + c] =
            static_cast<uint8_t>(std::lround(upper + (y - y0) * (lower - upper)));
      }
    }
  return out;
}

}  // namespace lenticule::test
