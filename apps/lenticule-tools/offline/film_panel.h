// SPDX-License-Identifier: Apache-2.0
// FilmPanel is the panel that a film is rendered for: one alone, or one of a wall.
#pragma once

#include <string>

#include "optics/wall/wall.h"
#include "render/scene/stage.h"

namespace lenticule::tools {

struct FilmPanel {
  optics::TrimmedRig trimmed;
  render::Canvas canvas;  ///< the panel, or the rectangle around all panels of the wall
  std::string name{};     ///< the panel's name in its wall; empty for a panel alone
  Affine canvas_from_panel{};

  [[nodiscard]] bool in_wall() const { return !name.empty(); }
};

/// Loads the rig of a panel alone. Throws Error(Input).
[[nodiscard]] FilmPanel panel_of_rig(const std::string& rig_file);

/// Returns a panel of a wall. The scene's centre lies in the middle of the rectangle around all
/// panels, in the wall's plane z = 0.
[[nodiscard]] FilmPanel panel_of_wall(const optics::PlacedWall& wall,
                                      const optics::PlacedPanel& panel);

/// Returns the panel of a rig, or the named panel of a wall if there is a wall. Throws Error(Usage)
/// for a wall without the name of a panel, and Error(Input).
[[nodiscard]] FilmPanel panel_of_rig_or_wall(const std::string& rig_file,
                                             const std::string& wall_file,
                                             const std::string& panel);

/// Returns optics::file_of_panel(). Throws Error(Usage) for a target that is no file.
[[nodiscard]] std::string target_of_panel(const std::string& target, const std::string& panel);

}  // namespace lenticule::tools
