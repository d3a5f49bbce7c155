// SPDX-License-Identifier: Apache-2.0
// Reads the vertices, faces and triangle strips of a PLY file into a mesh.
#pragma once

#include <cstddef>
#include <string>
#include <string_view>

#include "render/loaders/ply/header.h"
#include "render/scene/scene_description.h"

namespace lenticule::render::ply {

struct Elements {
  TriangleMesh mesh;              ///< mesh as it is in the file, not cleaned
  bool single_precision = false;  ///< true if the positions come from single precision
  bool face_colours = false;      ///< true if faces have colours, which the mesh does not have
  size_t ignored = 0;             ///< elements of other kinds, and faces with less than 3 corners
};

/// Reads the elements after the header of `text`. Throws Error(Input) "source: element: reason".
[[nodiscard]] Elements read_elements(const Header& header, std::string_view text,
                                     const std::string& source);

}  // namespace lenticule::render::ply
