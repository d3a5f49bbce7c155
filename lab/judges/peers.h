// SPDX-License-Identifier: Apache-2.0
// Other ray tracers (peers) that `lenticule bench exact --peers` runs as child processes for
// comparison.
#pragma once

#include <chrono>
#include <optional>
#include <string>
#include <vector>

#include "render/scene/scene_description.h"

namespace lenticule::lab {

/// The job of a peer: a picture of `width` x `height` rays from the scene's camera.
struct PeerJob {
  int width = 0;
  int height = 0;
  int threads = 0;  ///< the caller replaces "all cores" by their number
  int max_depth = 1;
  /// File for the picture; empty = discard it as fast as the peer can.
  std::string picture;
};

struct Peer {
  const char* name;
  const char* program;    ///< searched for in $PATH
  const char* extension;  ///< extension of its scene files
  std::string (*write_scene)(const render::SceneDescription& scene);
  /// Returns the arguments without the program itself.
  std::vector<std::string> (*arguments)(const std::string& scene_file, const PeerJob& job);
  /// Returns the seconds of ray tracing, without parsing and preparation, from the program's
  /// output.
  std::optional<double> (*traced_seconds)(const std::string& output);
  /// Returns the intended speed ratio of this renderer to the peer, by the built-in scene's name; 0
  /// = no target.
  double (*target)(const std::string& scene);
};

[[nodiscard]] const std::vector<Peer>& peers();

/// Returns the scene as NFF for any reader: without comments and colours of lights, with triangles,
/// and with the mean colour of textures. Throws Error(Usage) for a scene without a camera.
[[nodiscard]] std::string write_plain_nff(const render::SceneDescription& scene);

/// Returns the size of a picture of about `rays` pixels with this aspect; both sides are at least
/// 1.
[[nodiscard]] PeerJob peer_picture(double rays, double aspect);

}  // namespace lenticule::lab
