// SPDX-License-Identifier: Apache-2.0
#include "render/scene/scene_fingerprint.h"

namespace lenticule::render {

Fingerprint scene_fingerprint(const SceneDescription& scene, const Surroundings& surroundings,
                              const Stage& stage) {
  SceneMixer mixer;
  mixer.add(scene.materials);
  mixer.add(scene.meshes);
  mixer.add(scene.spheres);
  mixer.add(scene.cones);
  mixer.add(scene.lights);
  mixer.add(scene.background);
  mixer.add(scene.ambient);
  mixer.add(scene.colour_managed);
  mixer.add(surroundings.background);
  mixer.add(surroundings.sky);
  mixer.add(surroundings.environment_file);
  mixer.add(surroundings.ground);
  mixer.add(surroundings.ground_shadow);
  mixer.add(surroundings.ground_colour);
  mixer.add(surroundings.tone_map.has_value());
  mixer.add(static_cast<int>(surroundings.tone_map.value_or(ToneMap::None)));
  // The default sun depends on the viewer.
  if (scene.lights.empty() && !scene.ambient)
    mixer.add(world_direction(stage, kDefaultSunDirection));
  return mixer.value();
}

Fingerprint picture_fingerprint(const Fingerprint& scene, const Stage& stage) {
  SceneMixer mixer;
  mixer.add(scene.first);
  mixer.add(scene.second);
  for (const Affine& map : {stage.world_from_panel, stage.canvas_from_panel})
    for (const Vec3& column : {map.column_x, map.column_y, map.column_z, map.origin})
      mixer.add(column);
  mixer.add(stage.near_mm);
  mixer.add(stage.ground.has_value());
  mixer.add(stage.ground.value_or(Ground{}).y);
  mixer.add(stage.ground.value_or(Ground{}).size);
  return mixer.value();
}

}  // namespace lenticule::render
