// SPDX-License-Identifier: Apache-2.0
#include "render/scene/scene_fingerprint.h"

namespace lenticule::render {

Fingerprint scene_fingerprint(const SceneDescription& scene, const Surroundings& surroundings) {
  SceneMixer mixer;
  mixer.add(scene.materials, scene.meshes, scene.shapes, scene.spheres, scene.cones, scene.lights,
            scene.background, scene.ambient, scene.colour_managed, scene.lit_by_studio);
  mixer.add(surroundings.background, surroundings.sky, surroundings.environment_file,
            surroundings.ground, surroundings.ground_shadow, surroundings.ground_colour,
            surroundings.tone_map.has_value(),
            static_cast<int>(surroundings.tone_map.value_or(ToneMap::None)));
  return mixer.value();
}

Fingerprint picture_fingerprint(const Fingerprint& scene, const Stage& stage) {
  SceneMixer mixer;
  mixer.add(scene.first, scene.second);
  mixer.add(stage.world_from_panel, stage.canvas_from_panel);
  const Ground ground = stage.ground.value_or(Ground{});
  mixer.add(stage.near_mm, stage.ground.has_value(), ground.y, ground.size);
  return mixer.value();
}

}  // namespace lenticule::render
