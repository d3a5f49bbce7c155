// SPDX-License-Identifier: Apache-2.0
// Makes the pictures of the window: what two eyes see of a sent picture, in one picture.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <functional>
#include <future>
#include <vector>

#include "base/error.h"
#include "frames/frame.h"
#include "frames/weave.h"
#include "optics/model.h"

namespace lenticule::window {

/// EyePair is the place of a viewer's two eyes in front of the panel, as the mouse moves it, in
/// millimetres in the panel frame.
class EyePair {
 public:
  /// Begins in the middle of the viewing line, or at twice the panel's width if the rig's line is
  /// infinitely far away.
  explicit EyePair(const optics::OpticalModel& model)
      : model_(model),
        first_distance_mm_(first_distance(model.rig())),
        distance_mm_(first_distance_mm_) {
    centre();
  }

  /// Moves the eyes with the mouse: (0, 0) is the window's top left, (1, 1) its bottom right. The
  /// window's width is two lobes, its height the panel's height.
  void follow_mouse(double across, double down) {
    const optics::Panel& panel = model_.rig().panel;
    across_ = 2.0 * (across - 0.5);
    up_mm_ = model_.design_eye().y + (0.5 - down) * panel.height_px * panel.pixel_height.value;
  }
  /// Moves the eyes nearer (negative steps) or away, by a twentieth per step.
  void step_back(double steps) {
    distance_mm_ = std::clamp(distance_mm_ * std::pow(1.05, steps), first_distance_mm_ / kFarthest,
                              first_distance_mm_ * kFarthest);
  }
  /// Moves the eyes to the beginning.
  void centre() {
    across_ = 0.0;
    up_mm_ = model_.design_eye().y;
    distance_mm_ = first_distance_mm_;
  }

  [[nodiscard]] optics::Eye left() const { return at(-0.5); }
  [[nodiscard]] optics::Eye right() const { return at(0.5); }
  /// Returns the place between the eyes.
  [[nodiscard]] optics::Eye middle() const { return at(0.0); }

 private:
  static constexpr double kBetweenEyesMm = 65.0;
  static constexpr double kFarthest =
      5.0;  ///< times the first distance; the nearest is a fifth of it

  static double first_distance(const optics::Rig& rig) {
    const double distance = rig.viewing.distance.value;
    return std::isinf(distance) ? 2.0 * rig.panel.width_px * rig.panel.pixel_width.value : distance;
  }
  [[nodiscard]] optics::Eye at(double side) const {
    return {.x = model_.design_eye().x + across_ * model_.lobe_width_mm(distance_mm_) +
                 side * kBetweenEyesMm,
            .y = up_mm_,
            .z_mm = distance_mm_};
  }

  optics::OpticalModel model_;
  double first_distance_mm_;
  double across_ = 0.0;  ///< lobes to the right
  double up_mm_ = 0.0;
  double distance_mm_;
};

enum class Look {
  SideBySide,  ///< the left eye's picture on the left, the right eye's on the right
  Anaglyph,    ///< the left eye's red, the right eye's green and blue: for red-cyan glasses
};

/// Copies the channels [begin, end) of a picture to a place in the window.
inline void draw(const frames::WovenFrame& picture, int begin, int end, optics::PixelPlace at,
                 frames::WovenFrame& window) {
  const uint8_t* from = picture.bytes().data();
  for (int j = 0; j < picture.height(); ++j) {
    uint8_t* to = window.row(at.row + j) + 3 * static_cast<ptrdiff_t>(at.column);
    for (int i = 0; i < picture.width(); ++i, from += 3, to += 3)
      std::copy(from + begin, from + end, to + begin);
  }
}

/// Returns the woven frame that a viewer sees of the picture of XRGB words that was sent to the
/// panel.
[[nodiscard]] inline frames::WovenFrame seen_frame(const std::vector<uint32_t>& sent,
                                                   const optics::Panel& panel) {
  const optics::PixelGrid size = panel.sent_size(), seen{panel.width_px, panel.height_px};
  LENTICULE_CHECK(sent.size() ==
                  static_cast<size_t>(size.width) * static_cast<size_t>(size.height));
  frames::WovenFrame frame({.width = seen.width, .height = seen.height});
  const uint32_t* word = sent.data();
  for (int j = 0; j < size.height; ++j)
    for (int i = 0; i < size.width; ++i, ++word) {
      const optics::PixelPlace at = panel.mounting.seen_place({i, j}, seen);
      uint8_t* const rgb = frame.row(at.row) + 3 * static_cast<ptrdiff_t>(at.column);
      for (int c = 0; c < 3; ++c) rgb[c] = static_cast<uint8_t>(*word >> (16 - 8 * c));
    }
  return frame;
}

/// Returns the largest size of one eye's picture that fits into the window with the panel's aspect.
[[nodiscard]] inline optics::PixelGrid eye_size(const optics::Panel& panel, Look look,
                                                optics::PixelGrid window) {
  const int room = look == Look::SideBySide ? window.width / 2 : window.width;
  const double aspect =
      panel.width_px * panel.pixel_width.value / (panel.height_px * panel.pixel_height.value);
  const double width = std::min<double>(room, window.height * aspect);
  return {std::clamp(static_cast<int>(std::lround(width)), 1, std::max(room, 1)),
          std::clamp(static_cast<int>(std::lround(width / aspect)), 1, std::max(window.height, 1))};
}

/// Returns the window's picture; black where the eyes' pictures leave room.
[[nodiscard]] inline frames::WovenFrame window_picture(const optics::OpticalModel& model,
                                                       const frames::WovenFrame& woven,
                                                       const EyePair& eyes, Look look,
                                                       optics::PixelGrid window) {
  const optics::PixelGrid size = eye_size(model.rig().panel, look, window);
  const optics::EyeOptions options{.width = size.width, .height = size.height};
  auto left_later = std::async(std::launch::async, frames::seen_by, std::cref(model), woven.view(),
                               eyes.left(), options);
  const frames::WovenFrame right = frames::seen_by(model, woven.view(), eyes.right(), options);
  const frames::WovenFrame left = left_later.get();

  frames::WovenFrame picture({.width = window.width, .height = window.height});
  const int top = (window.height - size.height) / 2;
  if (look == Look::SideBySide) {
    const int half = window.width / 2;
    draw(left, 0, 3, {half - size.width, top}, picture);
    draw(right, 0, 3, {half, top}, picture);
  } else {
    const int edge = (window.width - size.width) / 2;
    draw(left, 0, 1, {edge, top}, picture);
    draw(right, 1, 3, {edge, top}, picture);
  }
  return picture;
}

}  // namespace lenticule::window
