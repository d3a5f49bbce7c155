// SPDX-License-Identifier: Apache-2.0
// RenderFlags are the flags of `lenticule render` that determine the pixels of frames.
#pragma once

#include <functional>
#include <string>

#include "apps/lenticule-tools/cli/staging_flags.h"
#include "render/options/render_options.h"

namespace CLI {
class App;
}

namespace lenticule::tools {

struct RenderFlags {
  std::string scene;
  std::string rig;    ///< empty with a wall
  std::string wall;   ///< empty without one
  std::string panel;  ///< name of the only panel of the wall to render; empty: all panels
  std::string method = "full";
  std::string frames = "0:1";
  std::string fps = "30";
  std::string camera;
  double least_psnr_db = 0.0;  ///< 0: not asked
  render::RenderOptions options;
  StagingFlags staging;
  std::string prefilter = "off";
};

/// Declares the scene and the flags. Returns a function to be called after parsing, which chooses a
/// rig if none is given and checks what the parser cannot, and throws Error(Usage). Lifetime:
/// `flags` must outlive the parser.
[[nodiscard]] std::function<void()> declare_render_flags(CLI::App& app, RenderFlags& flags);

}  // namespace lenticule::tools
