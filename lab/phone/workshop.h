// SPDX-License-Identifier: Apache-2.0
// Draws random workshops, each with a panel, a sheet on it and a phone in the hand, and compares
// rigs with the ground truth of their sheet.
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "lab/phone/phone_photo.h"
#include "optics/rig.h"

namespace lenticule::lab {

/// Workshop holds what is there, what its owner believes, and the photographs taken.
struct Workshop {
  SimulatedSheet build;
  optics::Rig start;  ///< values of the owner, with the exact panel
  Phone phone;
  std::vector<Shot> shots;
};

/// WorkshopLimits bounds the draw.
struct WorkshopLimits {
  int panel_width = 3840;
  double diagonal_inches = 27.0;
  int phone_width = 4000;  ///< longer side of the sensor
  double least_pitch_subpx = 4.0;
  double most_pitch_subpx = 11.0;
  int shots = 3;
  /// Root mean square of the smooth displacement that the correction of the phone's lens leaves, in
  /// parts of the picture's longer side.
  double least_warp = 0.0001, most_warp = 0.0005;
};

/// Returns the limits for a panel and a phone of other widths. The chart's tags need room: a panel
/// of less than 3840 pixels gets only finer lenses.
[[nodiscard]] WorkshopLimits limits_for(int panel_width, int phone_width);

/// Returns the workshop of a seed. The first shots of workshops that differ only in their number
/// are equal. The owner stands in front of the panel with the phone upside down, then holds it up
/// at the left, then at the right, then there again upside down, then in front; every place,
/// direction and turn is off by what a hand does.
[[nodiscard]] Workshop draw_workshop(uint64_t seed, const WorkshopLimits& limits);

/// Sweep is the motion of a phone that takes a film: along an arc from the upper left, past the
/// middle, to the upper right, with the wobble of a hand.
class Sweep {
 public:
  /// Draws the motion of a seed before the panel of a workshop.
  Sweep(uint64_t seed, const Workshop& workshop);
  [[nodiscard]] double seconds() const { return seconds_; }
  /// Returns the frame at a time from the beginning, with its motion.
  [[nodiscard]] Shot at(double seconds) const;

 private:
  /// Wobble is a sum of three waves.
  struct Wobble {
    std::array<double, 3> size{}, hertz{}, phase{};
    [[nodiscard]] double at(double seconds) const;
  };
  [[nodiscard]] Shot still(double seconds) const;

  uint64_t seed_;
  double seconds_, distance_;
  double room_light_, breathing_, exposure_s_, stabilisation_, stabilisation_turn_;
  std::array<Wobble, 6> wobble_;  ///< eye x, y, z; point looked at x, y; roll
};

/// Makes the phone of a workshop one that takes films of this width: cropped to 16:9, without an
/// own focal length, compressed more.
void make_film_camera(uint64_t seed, int width, Phone& phone);

/// Returns the 15 eyes at which a rig is judged: up to 250 mm to each side, at 0.8, 1 and 1.2 of
/// the viewing distance.
[[nodiscard]] std::vector<Vec3> judged_eyes(const optics::Rig& start);

/// Returns the largest difference, in lenses, between the phases of a rig and the ground truth, for
/// green light, at 29 x 17 points of the panel and the eyes. A whole number of lenses does not
/// count.
[[nodiscard]] double worst_error(const optics::Rig& rig, const SheetShape& sheet,
                                 const std::vector<Vec3>& eyes);

}  // namespace lenticule::lab
