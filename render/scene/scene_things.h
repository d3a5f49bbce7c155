// SPDX-License-Identifier: Apache-2.0
// What a committed scene is made of, thing by thing, to be compared with the next frame's.
#pragma once

#include <memory>
#include <vector>

#include "render/scene/fingerprint.h"
#include "render/scene/scene.h"
#include "render/scene/stage.h"

namespace lenticule::render {

/// Outlives its scene.
struct SceneThings {
  struct Thing {
    Fingerprint made_of;
    Bounds box;                    ///< in the scene frame, millimetres on the glass
    bool depends_on_view = false;  ///< it mirrors, shines or lets light through
  };

  SceneThings() = default;
  explicit SceneThings(const Scene& scene);

  bool known = false;
  Fingerprint rest;           ///< all else but the pixels of textures
  std::vector<Thing> things;  ///< meshes, spheres, cones
  std::vector<std::shared_ptr<const Texture>> textures;
  std::shared_ptr<const Texture> environment;
};

/// Whether two frames differ in their things at most, one by one.
[[nodiscard]] bool differ_in_things_only(const SceneThings& a, const SceneThings& b);

}  // namespace lenticule::render
