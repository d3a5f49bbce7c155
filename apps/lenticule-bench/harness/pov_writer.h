// SPDX-License-Identifier: Apache-2.0
// write_pov writes a scene in the language of POV-Ray 3.7, to compare that program with this
// renderer.
#pragma once

#include <string>

#include "render/scene/scene_description.h"

namespace lenticule::player {

struct PovOptions {
  double aspect = 1.0;  ///< width over height of the picture
  int max_depth = 1;    ///< bounces of mirrored and refracted rays
};

/// Writes the scene with the shading of docs/render/rendering.md as far as POV-Ray supports it:
/// meshes with normals, spheres, open cones, point lights with hard shadows, ambient, diffuse and
/// Phong terms, mirrors. The description must have no nodes, as from at_time(), and a camera.
/// Throws Error(Usage) that names an unsupported property: textures, lights other than points, no
/// camera.
[[nodiscard]] std::string write_pov(const render::SceneDescription& scene,
                                    const PovOptions& options);

}  // namespace lenticule::player
