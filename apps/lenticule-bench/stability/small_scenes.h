// SPDX-License-Identifier: Apache-2.0
// Scenes, scene placements and rigs that the rows of `bench stability` share.
#pragma once

#include "frames/frame.h"
#include "optics/rig.h"
#include "render/make_method.h"
#include "render/scene/scene.h"
#include "render/scene/scene_description.h"
#include "render/scene/stage.h"

namespace lenticule::bench {

/// Returns a placement whose world units are millimetres on the panel; `centre` is in the panel's
/// middle. Clips nothing.
[[nodiscard]] render::Stage plain_stage(Vec3 centre = {}, double mm_per_unit = 1.0);

/// One triangle slightly in front of the panel, for tests that need rays and no picture.
struct PlainStage {
  explicit PlainStage(const optics::Rig& rig);
  render::Scene scene;
};

/// Returns a closed ball of triangles, with many corners at which 2 * `rings` triangles meet; no
/// normals.
[[nodiscard]] render::TriangleMesh ball_mesh(Vec3 centre, double radius, uint32_t rings);
/// Returns a flat rectangle of `side` x `side` squares of two triangles; its front is cross(a, b).
[[nodiscard]] render::TriangleMesh grid_mesh(Vec3 corner, Vec3 a, Vec3 b, uint32_t side);
[[nodiscard]] render::TriangleMesh box_mesh(Vec3 low, Vec3 high, int material);

/// Returns a rig with a panel of coarse pixels, 160x96, seen from 400 mm.
[[nodiscard]] optics::Rig small_rig();

/// Returns a scene with every kind of object: meshes, spheres, cones, mirrors, transparent objects,
/// shadows; about 6 units wide.
[[nodiscard]] render::SceneDescription mixed_scene();

/// Returns the scene scaled about the origin and then moved.
[[nodiscard]] render::SceneDescription moved(render::SceneDescription scene, double scale,
                                             Vec3 offset);

/// Renders one frame with method full. Throws Error(Failed) if a ray was not finite.
[[nodiscard]] frames::WovenFrame render_small(const render::SceneDescription& scene,
                                              const render::Stage& stage, const optics::Rig& rig,
                                              int threads);

struct SmallFrame {
  frames::WovenFrame frame;
  render::RenderStatistics statistics;
};
/// Renders the method's next frame; `rig` is the rig of the method. Throws Error(Failed) if a ray
/// was not finite.
[[nodiscard]] SmallFrame next_frame(render::Method& method, const render::Scene& scene,
                                    const render::Stage& stage, const optics::Rig& rig);

/// Returns the same panel with `times` as many pixels along each side.
[[nodiscard]] optics::Rig finer(optics::Rig rig, int times);

/// Returns a material that only emits light.
[[nodiscard]] render::Material glowing(Vec3 colour);
/// Returns a scene for such materials: no lights, no ambient light.
[[nodiscard]] render::SceneDescription dark_scene(Vec3 background);

}  // namespace lenticule::bench
