// SPDX-License-Identifier: Apache-2.0
// Makes the pictures of the window: what two eyes see of a sent picture, in one picture.
#pragma once

#include <cstdint>
#include <vector>

#include "frames/frame.h"
#include "optics/model.h"

namespace lenticule::window {

/// EyePair is the place of a viewer's two eyes in front of the panel, as the mouse moves it, in
/// millimetres in the panel frame.
class EyePair {
 public:
  /// Begins in the middle of the viewing line, or at twice the panel's width if the rig's line is
  /// infinitely far away.
  explicit EyePair(const optics::OpticalModel& model);

  /// Moves the eyes with the mouse: (0, 0) is the window's top left, (1, 1) its bottom right. The
  /// window's width is two viewing zones, its height the panel's height.
  void follow_mouse(double across, double down);
  /// Moves the eyes nearer (negative steps) or away, by a twentieth per step.
  void step_back(double steps);
  /// Moves the eyes to the beginning.
  void centre();

  [[nodiscard]] optics::Eye left() const { return at(-0.5); }
  [[nodiscard]] optics::Eye right() const { return at(0.5); }
  /// Returns the place between the eyes.
  [[nodiscard]] optics::Eye middle() const { return at(0.0); }

 private:
  [[nodiscard]] optics::Eye at(double side) const;

  optics::OpticalModel model_;
  double first_distance_mm_;
  double across_ = 0.0;  ///< viewing zones to the right
  double up_mm_ = 0.0;
  double distance_mm_;
};

enum class Look {
  SideBySide,  ///< the left eye's picture on the left, the right eye's on the right
  Anaglyph,    ///< the left eye's red, the right eye's green and blue: for red-cyan glasses
};

/// Returns the woven frame that a viewer sees of the picture of XRGB words that was sent to the
/// panel.
[[nodiscard]] frames::WovenFrame seen_frame(const std::vector<uint32_t>& sent,
                                            const optics::Panel& panel);

/// Returns the largest size of one eye's picture that fits into the window with the panel's aspect.
[[nodiscard]] optics::PixelGrid eye_size(const optics::Panel& panel, Look look,
                                         optics::PixelGrid window);

/// Returns the window's picture; black where the eyes' pictures leave room.
[[nodiscard]] frames::WovenFrame window_picture(const optics::OpticalModel& model,
                                                const frames::WovenFrame& woven,
                                                const EyePair& eyes, Look look,
                                                optics::PixelGrid window);

}  // namespace lenticule::window
