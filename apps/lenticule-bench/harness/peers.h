// SPDX-License-Identifier: Apache-2.0
// Other ray tracers that `lenticule bench exact --peers` runs beside ours, as child processes.
#pragma once

#include <chrono>
#include <optional>
#include <string>
#include <vector>

#include "render/scene/scene_description.h"

namespace lenticule::player {

/// What a peer is asked for: a picture of `width` x `height` rays from the scene's camera.
struct PeerJob {
  int width = 0;
  int height = 0;
  int threads = 0;  ///< all cores are to be counted by the caller
  int max_depth = 1;
  /// Where to keep the picture; empty = throw it away as fast as the peer can.
  std::string picture;
};

struct Peer {
  const char* name;
  const char* program;    ///< looked for in $PATH
  const char* extension;  ///< of its scene files
  std::string (*write_scene)(const render::SceneDescription& scene, const PeerJob& job);
  /// Without the program itself.
  std::vector<std::string> (*arguments)(const std::string& scene_file, const PeerJob& job);
  /// The seconds of tracing rays, parsing and preparing left out, from what it prints.
  std::optional<double> (*traced_seconds)(const std::string& output);
  /// How many times faster we want to be, by the built-in scene's name; 0 = no wish.
  double (*target)(const std::string& scene);
};

[[nodiscard]] const std::vector<Peer>& peers();

/// The scene as NFF that any program reads: no comments, no colours of lights, triangles, the mean
/// colour of textures. Throws Error(Usage) for a scene without a camera.
[[nodiscard]] std::string write_plain_nff(const render::SceneDescription& scene);

/// How a picture of about `rays` pixels with this aspect is cut; both sides are at least 1.
[[nodiscard]] PeerJob peer_picture(double rays, double aspect);

}  // namespace lenticule::player
