// SPDX-License-Identifier: Apache-2.0
// Wall describes several panels that show one picture: the rig of each, its place, and where the
// viewer stands. docs/play/walls.md has the list of keys.
#pragma once

#include <filesystem>
#include <string>
#include <string_view>
#include <vector>

#include "base/interval.h"
#include "optics/trim.h"
#include "optics/vec.h"

namespace lenticule::optics {

/// WallPanel is the place of one panel. The wall's frame is in millimetres, x right, y up, z toward
/// the viewer. The panel is first rolled, then tilted, then turned, about its centre.
struct WallPanel {
  std::string name;  ///< letters, digits, '-' and '_'; becomes a part of file names
  std::string rig;   ///< rig file, relative to the folder of the wall's file
  Vec3 centre_mm;
  double turn_degrees = 0.0;  ///< rotation about the vertical axis; positive: faces further right
  double tilt_degrees = 0.0;  ///< rotation about the horizontal axis; positive: faces further up
  double roll_degrees = 0.0;  ///< rotation in its plane; positive: counter-clockwise for viewers
  /// Connector of the panel, such as "DP-1", for a wall on one graphics card; empty: the one whose
  /// panel has the rig's identity.
  std::string output{};
  friend bool operator==(const WallPanel&, const WallPanel&) = default;
};

struct Wall {
  Vec3 viewer_mm;
  std::vector<WallPanel> panels;
  friend bool operator==(const Wall&, const Wall&) = default;
};

/// Limits for walls from outside.
inline constexpr size_t kMaxWallPanels = 64;
inline constexpr double kMaxWallMm = 1e6;          ///< limit per coordinate
inline constexpr double kMaxFacingDegrees = 85.0;  ///< limit of turn and tilt
inline constexpr double kMaxRollDegrees = 45.0;    ///< beyond it the mounting of the rig changes

/// Parses a wall. Every failure is an Error(Input) that starts with "source:line:". Does not read
/// the rig files.
[[nodiscard]] Wall parse_wall(std::string_view toml, const std::string& source);

/// Returns the map from the panel's frame to the wall's: a rotation and a translation.
[[nodiscard]] Affine wall_from_panel(const WallPanel& panel);

/// PlacedPanel is a panel of a wall with its rig. The rig's viewing line leads through the wall's
/// viewer, so that all panels show this viewer one picture.
struct PlacedPanel {
  std::string name;
  std::string output;
  Rig calibrated;  ///< without the trim
  Trim trim;
  TrimmedRig trimmed;
  Affine wall_from_panel;
  Interval x_mm, y_mm;  ///< extent in the wall's frame
};

/// Returns the file of one panel of a film that is made for a wall: "film.lts" and "film" become
/// "film-left.lts", and "out/%05d.png" becomes "out/%05d-left.png".
[[nodiscard]] std::string file_of_panel(const std::string& file, const std::string& panel);

struct PlacedWall {
  Vec3 viewer_mm;
  std::vector<PlacedPanel> panels;

  /// Returns the panel of that name. Throws Error(Usage), which lists the names.
  [[nodiscard]] const PlacedPanel& panel(const std::string& name) const;
};

/// Loads a wall and the rigs of its panels with their trims. Throws Error(Input) for files that
/// cannot be read or are not valid, and for a panel that does not face the viewer.
[[nodiscard]] PlacedWall load_wall(const std::filesystem::path& file);

}  // namespace lenticule::optics
