// SPDX-License-Identifier: Apache-2.0
// Imports key frames from glTF.
#pragma once

#include "render/loaders/gltf/nodes.h"

namespace lenticule::render::gltf {

/// Imports the first animation of the file, after the meshes.
void import_animation(Document& document, const Nodes& nodes, SceneDescription& scene,
                      Notes& notes);

}  // namespace lenticule::render::gltf
