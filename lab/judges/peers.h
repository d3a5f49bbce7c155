// SPDX-License-Identifier: Apache-2.0
// Tachyon, another ray tracer, which `lenticule bench exact --peers` runs as a child process for
// comparison.
#pragma once

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

/// Returns Tachyon's arguments without the program itself.
[[nodiscard]] std::vector<std::string> tachyon_arguments(const std::string& scene_file,
                                                         const PeerJob& job);
/// Returns the seconds of ray tracing, without parsing and preparation, from Tachyon's output.
[[nodiscard]] std::optional<double> tachyon_seconds(const std::string& output);
/// Returns the intended speed ratio of this renderer to Tachyon for a built-in scene; 0 = none.
[[nodiscard]] double tachyon_target(const std::string& scene);

/// Returns the scene as NFF for any reader: without comments and colours of lights, with triangles,
/// and with the mean colour of textures. Tachyon always uses a field of view of 53 degrees and
/// mirrors the picture: it shows slightly more background than this renderer, which is to its
/// advantage. Throws Error(Usage) for a scene without a camera.
[[nodiscard]] std::string write_plain_nff(const render::SceneDescription& scene);

/// Returns the size of a picture of about `rays` pixels with this aspect; both sides are at least
/// 1.
[[nodiscard]] PeerJob peer_picture(double rays, double aspect);

}  // namespace lenticule::lab
