// SPDX-License-Identifier: Apache-2.0
// Turns pictures and points by the words that a rig file uses: first the mirror, then quarter turns
// clockwise, one after the other. It shares no code with optics/mounting.
#pragma once

#include <algorithm>
#include <array>
#include <string>

#include "frames/frame.h"
#include "optics/vec.h"

namespace lenticule::test {

inline constexpr std::array<const char*, 8> kMountingNames{
    "0", "90", "180", "270", "mirrored", "mirrored 90", "mirrored 180", "mirrored 270"};

struct Turn {
  bool mirrored = false;
  int quarters = 0;  ///< clockwise, after the mirror
};

[[nodiscard]] inline Turn turn_of(const std::string& name) {
  const bool mirrored = name.starts_with("mirrored");
  const std::string degrees = name.substr(std::min(name.size(), name.find_last_of(' ') + 1));
  return {mirrored, degrees == "mirrored" ? 0 : std::stoi(degrees) / 90};
}

[[nodiscard]] inline frames::WovenFrame mirrored(const frames::WovenFrame& picture) {
  frames::WovenFrame out(picture.geometry());
  for (int j = 0; j < picture.height(); ++j)
    for (int i = 0; i < picture.width(); ++i)
      std::copy_n(picture.row(j) + 3 * i, 3, out.row(j) + 3 * (picture.width() - 1 - i));
  return out;
}

[[nodiscard]] inline frames::WovenFrame quarter_turned(const frames::WovenFrame& picture) {
  frames::WovenFrame out({.width = picture.height(), .height = picture.width()});
  for (int j = 0; j < picture.height(); ++j)
    for (int i = 0; i < picture.width(); ++i)
      std::copy_n(picture.row(j) + 3 * i, 3, out.row(i) + 3 * (picture.height() - 1 - j));
  return out;
}

/// Returns what a viewer sees of the sent picture.
[[nodiscard]] inline frames::WovenFrame seen_of(const frames::WovenFrame& sent,
                                                const std::string& mounting) {
  const Turn turn = turn_of(mounting);
  frames::WovenFrame picture = turn.mirrored ? mirrored(sent) : sent;
  for (int q = 0; q < turn.quarters; ++q) picture = quarter_turned(picture);
  return picture;
}

/// Returns where a viewer sees a point, relative to the panel's centre, y upward.
[[nodiscard]] inline Vec2 seen_point(Vec2 sent, const std::string& mounting) {
  const Turn turn = turn_of(mounting);
  if (turn.mirrored) sent.x = -sent.x;
  for (int q = 0; q < turn.quarters; ++q) sent = {sent.y, -sent.x};
  return sent;
}

}  // namespace lenticule::test
