// SPDX-License-Identifier: Apache-2.0
#include "apps/lenticule-window/eye_pictures.h"

#include <algorithm>
#include <cmath>
#include <future>

#include "base/error.h"
#include "optics/eye_simulator.h"

namespace lenticule::window {
namespace {

using optics::RgbPicture;

RgbPicture look_with(const optics::OpticalModel& model, const frames::WovenFrame& woven,
                     const optics::Eye& eye, optics::PixelGrid size) {
  return optics::simulate_eye(model,
                              {.pixels = woven.bytes().data(),
                               .width = woven.width(),
                               .height = woven.height(),
                               .stride_bytes = woven.geometry().row_bytes()},
                              eye, {.width = size.width, .height = size.height});
}

/// Copies the channels [begin, end) of a picture to a place in the window.
void draw(const RgbPicture& picture, int begin, int end, optics::PixelPlace at,
          frames::WovenFrame& window) {
  const uint8_t* from = picture.pixels.data();
  for (int j = 0; j < picture.height; ++j) {
    uint8_t* to = window.row(at.row + j) + 3 * static_cast<ptrdiff_t>(at.column);
    for (int i = 0; i < picture.width; ++i, from += 3, to += 3)
      std::copy(from + begin, from + end, to + begin);
  }
}

}  // namespace

frames::WovenFrame seen_frame(const std::vector<uint32_t>& sent, const optics::Panel& panel) {
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

optics::PixelGrid eye_size(const optics::Panel& panel, Look look, optics::PixelGrid window) {
  const int room = look == Look::SideBySide ? window.width / 2 : window.width;
  const double aspect =
      panel.width_px * panel.pixel_width.value / (panel.height_px * panel.pixel_height.value);
  const double width = std::min<double>(room, window.height * aspect);
  return {std::clamp(static_cast<int>(std::lround(width)), 1, std::max(room, 1)),
          std::clamp(static_cast<int>(std::lround(width / aspect)), 1, std::max(window.height, 1))};
}

frames::WovenFrame window_picture(const optics::OpticalModel& model,
                                  const frames::WovenFrame& woven, const EyePair& eyes, Look look,
                                  optics::PixelGrid window) {
  const optics::PixelGrid size = eye_size(model.rig().panel, look, window);
  std::future<RgbPicture> left_later =
      std::async(std::launch::async, [&] { return look_with(model, woven, eyes.left(), size); });
  const RgbPicture right = look_with(model, woven, eyes.right(), size);
  const RgbPicture left = left_later.get();

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
