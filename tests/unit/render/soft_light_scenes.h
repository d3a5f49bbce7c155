// SPDX-License-Identifier: Apache-2.0
// A small scene for soft light, and pictures of any scene with it.
#pragma once

#include <vector>

#include "render/methods/method.h"
#include "render/options/render_options.h"
#include "render/scene/scene.h"
#include "render/scene/surroundings.h"
#include "tests/support/tiny_scenes.h"

namespace lenticule::render {

/// Picture is a rendered frame.
struct Picture {
  frames::WovenFrame frame;
  RenderStatistics statistics;
};

/// Renders a scene with method `full`.
inline Picture picture(const SceneDescription& description, const optics::Rig& rig,
                       const Stage& stage, const RenderOptions& options,
                       const Surroundings& surroundings = {}) {
  const optics::OpticalModel model(rig);
  const Scene scene(description, stage, surroundings, options.threads);
  Picture made{frames::WovenFrame({rig.panel.width_px, rig.panel.height_px}), {}};
  made.statistics = make_method("full", model, options)->render(scene, stage, made.frame);
  return made;
}

inline RenderOptions with(const SoftLight& soft) {
  return {.threads = 1, .soft = soft, .cancelled = {}};
}

/// Returns a matte white wall with a ball in front of it and an area light beside the eye: half of
/// the wall's light comes from the area light, the rest from the hemisphere.
inline SceneDescription wall_and_ball() {
  SceneDescription scene;
  scene.colour_managed = false;
  scene.ambient = Vec3{0.4, 0.4, 0.4};
  scene.background = {0.4, 0.4, 0.4};
  scene.materials = {Material{}};
  scene.meshes = {test::rectangle_mesh({-40, -40, -1}, {80, 0, 0}, {0, 80, 0}, 0)};
  scene.spheres = {{.centre = {0.1, 0.2, 0.4}, .radius = 1.0}};
  Light area_light;
  area_light.position = {1.5, 2.5, 9.0};
  area_light.colour = {0.6, 0.6, 0.6};
  scene.lights = {area_light};
  return scene;
}

inline SoftLight only_shadows(int samples) {
  return {.shadow_samples = samples, .light_radius_mm = 25.0};
}
inline SoftLight only_occlusion(int samples) {
  return {.occlusion_samples = samples, .occlusion_distance_mm = 30.0};
}
inline SoftLight only_environment(int samples) { return {.environment_samples = samples}; }

}  // namespace lenticule::render
