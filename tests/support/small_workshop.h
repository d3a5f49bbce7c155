// SPDX-License-Identifier: Apache-2.0
// The workshop in which tests calibrate from hand-held photographs: a panel whose photographs are
// simulated in about three seconds.
#pragma once

#include <filesystem>

#include "lab/phone/workshop.h"

namespace lenticule::test {

inline lab::WorkshopLimits small_workshop(int shots) {
  lab::WorkshopLimits limits;
  limits.panel_width = 1920;
  limits.diagonal_inches = 24.0;
  limits.phone_width = 3200;
  limits.least_pitch_subpx = 4.0;
  limits.most_pitch_subpx = 5.0;
  limits.shots = shots;
  return limits;
}

/// HandHeldPhone is a panel of the small workshop under its sheet, and the phone of its owner.
class HandHeldPhone {
 public:
  explicit HandHeldPhone(uint64_t seed = kSeed)
      : workshop_(lab::draw_workshop(seed, small_workshop(6))) {
    // A start that is more than 1 % off changes the chart after the first photograph.
    workshop_.start.sheet.pitch = Subpixels(1.004 * workshop_.build.pitch_subpx);
  }
  /// Returns the rig that the owner assumes before the calibration.
  [[nodiscard]] const optics::Rig& start() const { return workshop_.start; }
  [[nodiscard]] const lab::Shot& shot(size_t place) const { return workshop_.shots.at(place); }
  /// Photographs the panel that shows a frame, from place 0 to 5 of draw_workshop(); if it is
  /// `cut`, with a part of the panel out of the picture.
  void photograph(const frames::WovenFrame& shown, size_t place, const std::filesystem::path& file,
                  bool cut = false) const {
    lab::Shot shot = this->shot(place);
    const optics::Panel& panel = workshop_.start.panel;
    if (cut) shot.look_at_mm.x += panel.width_px * panel.pixel_width.value;
    write_photo(lab::photograph(sheet_, shown.view(), workshop_.phone, shot),
                workshop_.phone.jpeg_quality, file);
  }
  /// Photographs the panel from a place with zoom, which contradicts the other photographs.
  void photograph_zoomed(const frames::WovenFrame& shown, size_t place,
                         const std::filesystem::path& file) const {
    lab::Phone zoomed = workshop_.phone;
    zoomed.focal *= 1.08;
    write_photo(lab::photograph(sheet_, shown.view(), zoomed, shot(place)), zoomed.jpeg_quality,
                file);
  }
  /// Returns the largest phase error of a rig over panel and viewing zone, lenses.
  [[nodiscard]] double error_of(const optics::Rig& rig) const {
    return lab::worst_error(rig, sheet_, lab::judged_eyes(workshop_.start));
  }

 private:
  static constexpr uint64_t kSeed = 102;  ///< all its photographs can be measured
  lab::Workshop workshop_;
  lab::SheetShape sheet_{workshop_.start.panel, workshop_.build};
};

}  // namespace lenticule::test
