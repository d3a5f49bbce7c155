// SPDX-License-Identifier: Apache-2.0
// SceneObjects lists the primitives of a committed scene, for comparison with the next frame's
// scene.
#pragma once

#include <memory>
#include <vector>

#include "render/scene/scene.h"
#include "render/scene/scene_fingerprint.h"
#include "render/scene/stage.h"

namespace lenticule::render {

/// SceneObjects describes a committed scene, object by object. Lifetime: may outlive its scene.
struct SceneObjects {
  struct Object {
    Fingerprint made_of;
    Bounds box;                    ///< scene frame, millimetres on the panel
    bool depends_on_view = false;  ///< the object is reflective, has highlights or is transparent
  };

  SceneObjects() = default;
  explicit SceneObjects(const Scene& scene);

  bool known = false;
  Fingerprint rest;             ///< all other scene data, except texture pixels
  std::vector<Object> objects;  ///< meshes, spheres, cones
  std::vector<std::shared_ptr<const Texture>> textures;
  std::shared_ptr<const Texture> environment;
};

/// Returns true if the scenes are equal except for individual objects (meshes, spheres, cones).
[[nodiscard]] bool differ_in_objects_only(const SceneObjects& a, const SceneObjects& b);

}  // namespace lenticule::render
