// SPDX-License-Identifier: Apache-2.0
// Scenes, stages and rigs that the rows of `bench stability` share.
#pragma once

#include "frames/frame.h"
#include "optics/rig.h"
#include "render/make_method.h"
#include "render/scene/scene.h"
#include "render/scene/scene_description.h"
#include "render/scene/stage.h"

namespace lenticule::player {

/// World units are millimetres on the glass; `centre` lies in its middle. Nothing is left out.
[[nodiscard]] render::Stage plain_stage(Vec3 centre = {}, double mm_per_unit = 1.0);

/// One triangle a little in front of the glass, for those who want rays and no picture.
struct PlainStage {
  explicit PlainStage(const optics::Rig& rig);
  render::Scene scene;
};

/// A closed ball of triangles with many corners where 2 rings triangles meet; no normals.
[[nodiscard]] render::TriangleMesh ball_mesh(Vec3 centre, double radius, uint32_t rings);
/// A flat rectangle of `side` x `side` squares of two triangles; its front is cross(a, b).
[[nodiscard]] render::TriangleMesh grid_mesh(Vec3 corner, Vec3 a, Vec3 b, uint32_t side);
[[nodiscard]] render::TriangleMesh box_mesh(Vec3 low, Vec3 high, int material);

/// A panel of coarse pixels, 160x96, seen from 400 mm.
[[nodiscard]] optics::Rig small_rig();

/// Some of everything: meshes, spheres, cones, mirrors, glass, shadows; about 6 units wide.
[[nodiscard]] render::SceneDescription mixed_scene();

/// The same scene, scaled about the origin and then moved.
[[nodiscard]] render::SceneDescription moved(render::SceneDescription scene, double scale,
                                             Vec3 offset);

/// One frame by method full. Throws Error(Failed) where a ray was not finite.
[[nodiscard]] frames::WovenFrame render_small(const render::SceneDescription& scene,
                                              const render::Stage& stage, const optics::Rig& rig,
                                              int threads);

struct SmallFrame {
  frames::WovenFrame frame;
  render::RenderStatistics statistics;
};
/// The method's next frame; `rig` is the one that it was made for. Throws Error(Failed) where a ray
/// was not finite.
[[nodiscard]] SmallFrame next_frame(render::Method& method, const render::Scene& scene,
                                    const render::Stage& stage, const optics::Rig& rig);

/// The same panel with so many times the pixels along each side.
[[nodiscard]] optics::Rig finer(optics::Rig rig, int times);

/// A material that shines by itself and does nothing else.
[[nodiscard]] render::Material glowing(Vec3 colour);
/// A scene of such materials: no lamps, no ambient light.
[[nodiscard]] render::SceneDescription dark_scene(Vec3 background);

}  // namespace lenticule::player
