// SPDX-License-Identifier: Apache-2.0
// RenderFlags are the flags of `lenticule render` that determine the pixels of frames; among them
// StagingFlags, which place a scene in front of the panel and set its environment.
#pragma once

#include <functional>
#include <string>

#include "render/loaders/load_scene.h"
#include "render/options/render_options.h"
#include "render/scene/scene.h"
#include "render/scene/stage.h"

namespace CLI {
class App;
class Option;
}  // namespace CLI

namespace lenticule::tools {

struct StagingFlags {
  render::LoadOptions load;
  render::StageOptions stage;      ///< with the turn of the first frame
  double turned_by_degrees = 0.0;  ///< over all frames
  render::Surroundings surroundings;
};

/// Declares what of a model is shown, and how it is turned: for every command that reads one.
/// Returns the flag of the camera. Lifetime: `load` must outlive the parser.
CLI::Option* declare_model_flags(CLI::App& app, render::LoadOptions& load);

/// Declares the flags of the model, too. Lifetime: `flags` must outlive the parser.
void declare_stage_flags(CLI::App& app, StagingFlags& flags);
void declare_surroundings_flags(CLI::App& app, StagingFlags& flags);

// Declares flags for rendering with area lights and with light from the environment.

/// Lifetime: `soft` must outlive the parser.
void declare_soft_light_flags(CLI::App& app, render::SoftLight& soft);

// RenderFlags are the flags of `lenticule render` that determine the pixels of frames.

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
