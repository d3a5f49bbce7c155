// SPDX-License-Identifier: Apache-2.0
// Writes a scene in the language of POV-Ray 3.7, for running it beside our renderer.
#pragma once

#include <string>

#include "render/scene/scene_description.h"

namespace lenticule::player {

struct PovOptions {
  double aspect = 1.0;  ///< width over height of the picture
  int max_depth = 1;    ///< generations of mirrored and refracted rays
};

/// The scene with the shading of docs/rendering.md as far as POV-Ray has it: meshes with their
/// normals, spheres, open cones, point lights with hard shadows, ambient, diffuse and Phong terms,
/// mirrors. Of a description without nodes, as at_time() gives it, with a camera. Throws
/// Error(Usage) naming what cannot be said: textures, lights other than points, no camera.
[[nodiscard]] std::string write_pov(const render::SceneDescription& scene,
                                    const PovOptions& options);

}  // namespace lenticule::player
