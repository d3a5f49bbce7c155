// SPDX-License-Identifier: Apache-2.0
// EyePair is the place of a viewer's two eyes in front of the panel, as the mouse moves it.
#pragma once

#include "optics/model.h"

namespace lenticule::window {

/// Millimetres, in the panel frame.
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

}  // namespace lenticule::window
