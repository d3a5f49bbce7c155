// SPDX-License-Identifier: Apache-2.0
// Provides small handmade scenes, rigs and stages for tests of the renderer.
#pragma once

#include <string>
#include <vector>

#include "optics/model.h"
#include "render/scene/scene_description.h"
#include "render/scene/stage.h"

namespace lenticule::test {

struct NamedScene {
  std::string name;
  render::SceneDescription scene;
};

/// Returns scenes of about 6 x 4 x 4 units around the origin, y up, seen from +z. Together they use
/// every primitive, every kind of light, mirrors, glass, total reflection, textures, smooth
/// normals, inward and two-sided surfaces.
[[nodiscard]] std::vector<NamedScene> tiny_scenes();

/// Returns an axis-aligned box of twelve triangles that face outward.
[[nodiscard]] render::TriangleMesh box_mesh(Vec3 low, Vec3 high, int material);
/// Returns a sphere of triangles with vertex normals.
[[nodiscard]] render::TriangleMesh ball_mesh(Vec3 centre, double radius, int rings, int material);
/// Returns one rectangle, corner + side vectors; it faces toward cross(a, b).
[[nodiscard]] render::TriangleMesh rectangle_mesh(Vec3 corner, Vec3 a, Vec3 b, int material);

/// The parameters of a rig of large pixels that tests vary.
struct TinyRig {
  int width = 12;
  int height = 8;
  double pitch_subpx = 7.7;
  double slant = 1.0 / 3.0;
  std::string layout = "rgb";  ///< or "cells": a table of 2 x 2
  double distance_mm = 700.0;  ///< may be infinite
  double eye_height_mm = 0.0;
  double pixel_mm = 5.0;
};
[[nodiscard]] optics::Rig make_rig(const TinyRig& tiny);

/// The placement of a scene at the panel.
struct TinyStage {
  Vec3 centre{0, 0, 0};
  double mm_per_unit = 9.0;
  double depth_scale = 1.0;
  double turn_degrees = 0.0;
};
[[nodiscard]] render::Stage make_tiny_stage(const TinyStage& tiny = {});

/// Returns the scene, scaled about the origin and then moved.
[[nodiscard]] render::SceneDescription moved(render::SceneDescription scene, double scale,
                                             Vec3 offset);

}  // namespace lenticule::test
