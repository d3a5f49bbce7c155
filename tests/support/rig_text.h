// SPDX-License-Identifier: Apache-2.0
// Makes the text of rig files for tests of commands.
#pragma once

#include <sstream>
#include <string>

namespace lenticule::test {

struct RigText {
  std::string name = "small";
  int width_px = 48;
  int height_px = 32;
  double pixel_mm = 0.5;
  std::string more_of_panel{};  ///< further lines
  double pitch_subpx = 7.7;
  double slant = 0.25;
  double offset_lenses = 0.0;
  double gap_mm = 6.0;
  std::string more_of_sheet{};
  double distance_mm = 500.0;
};

[[nodiscard]] inline std::string rig_toml(const RigText& rig = {}) {
  std::ostringstream text;
  text << "format = 1\nname = \"" << rig.name << "\"\n[panel]\nwidth_px = " << rig.width_px
       << "\nheight_px = " << rig.height_px << "\npixel_width_mm = " << rig.pixel_mm
       << "\npixel_height_mm = " << rig.pixel_mm << "\n"
       << rig.more_of_panel << "[sheet]\npitch_subpx = " << rig.pitch_subpx
       << "\nslant = " << rig.slant << "\noffset_lenses = " << rig.offset_lenses
       << "\ngap_mm = " << rig.gap_mm << "\n"
       << rig.more_of_sheet << "[viewing]\ndistance_mm = " << rig.distance_mm << "\n";
  return text.str();
}

}  // namespace lenticule::test
