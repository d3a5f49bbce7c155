// SPDX-License-Identifier: Apache-2.0
#include "apps/lenticule-window/eye_pair.h"

#include <algorithm>
#include <cmath>

namespace lenticule::window {
namespace {

constexpr double kBetweenEyesMm = 65.0;
constexpr double kFarthest = 5.0;  ///< times the first distance; the nearest is a fifth of it

double first_distance(const optics::Rig& rig) {
  const double distance = rig.viewing.distance.value;
  return std::isinf(distance) ? 2.0 * rig.panel.width_px * rig.panel.pixel_width.value : distance;
}

}  // namespace

EyePair::EyePair(const optics::OpticalModel& model)
    : model_(model),
      first_distance_mm_(first_distance(model.rig())),
      distance_mm_(first_distance_mm_) {
  centre();
}

void EyePair::follow_mouse(double across, double down) {
  const optics::Panel& panel = model_.rig().panel;
  across_ = 2.0 * (across - 0.5);
  up_mm_ = model_.design_eye().y + (0.5 - down) * panel.height_px * panel.pixel_height.value;
}

void EyePair::step_back(double steps) {
  distance_mm_ = std::clamp(distance_mm_ * std::pow(1.05, steps), first_distance_mm_ / kFarthest,
                            first_distance_mm_ * kFarthest);
}

void EyePair::centre() {
  across_ = 0.0;
  up_mm_ = model_.design_eye().y;
  distance_mm_ = first_distance_mm_;
}

optics::Eye EyePair::at(double side) const {
  return {.x = model_.design_eye().x + across_ * model_.lobe_width_mm(distance_mm_) +
               side * kBetweenEyesMm,
          .y = up_mm_,
          .z_mm = distance_mm_};
}

}  // namespace lenticule::window
