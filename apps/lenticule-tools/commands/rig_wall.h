// SPDX-License-Identifier: Apache-2.0
// lenticule rig wall shows a wall: its panels, the gaps between them, and a drawing; and writes the
// rigs with which players show the films of the panels.
#pragma once

#include <string>

#include "base/exit_code.h"

namespace CLI {
class App;
}

namespace lenticule::tools {

struct RigWallFlags {
  std::string file;
  std::string svg;
  std::string rigs;  ///< folder for the rigs of the panels
};

/// Lifetime: `flags` must outlive the parser.
void declare_rig_wall_flags(CLI::App& app, RigWallFlags& flags);

/// Throws Error(Input) and Error(Failed).
ExitCode rig_wall(const RigWallFlags& flags, bool as_json);

}  // namespace lenticule::tools
