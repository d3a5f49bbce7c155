// SPDX-License-Identifier: Apache-2.0
// Rigs and scenes that are small enough to test the row sweep with every ray and every primitive.
#pragma once

#include <limits>
#include <random>
#include <string>
#include <utility>
#include <vector>

#include "render/scene/scene.h"
#include "tests/support/random_rigs.h"
#include "tests/support/tiny_scenes.h"

namespace lenticule::render {

inline constexpr double kInfinity = std::numeric_limits<double>::infinity();

/// NamedRig is a rig and its name in messages.
struct NamedRig {
  std::string name;
  optics::Rig rig;
};

/// Returns rigs of all kinds with a panel of a few pixels.
inline std::vector<NamedRig> tiny_rigs() {
  std::vector<NamedRig> rigs = {
      {"slanted", test::make_rig({})},
      {"upright", test::make_rig({.pitch_subpx = 9.0, .slant = 0.0})},
      {"eye above", test::make_rig({.eye_height_mm = 120.0})},
      {"parallel", test::make_rig({.distance_mm = kInfinity, .eye_height_mm = -0.2})},
      {"leaning left", test::make_rig({.pitch_subpx = 5.3, .slant = -0.7})},
      {"cells", test::make_rig({.layout = "cells"})},
      {"wide lenses", test::make_rig({.pitch_subpx = 31.4, .slant = 0.2})},
      {"narrow lenses", test::make_rig({.pitch_subpx = 2.2, .slant = 0.2})},
      {"near eye", test::make_rig({.distance_mm = 90.0})},
  };
  const auto add = [&](const char* name, auto change) {
    optics::Rig rig = test::make_rig({});
    change(rig);
    rigs.push_back({name, rig});
  };
  add("bgr", [](optics::Rig& rig) { rig.panel.layout = optics::SubpixelLayout::bgr(); });
  add("vrgb", [](optics::Rig& rig) { rig.panel.layout = optics::SubpixelLayout::vrgb(); });
  add("nudged colours", [](optics::Rig& rig) {
    rig.sheet.channel_offset = {Subpixels(-0.2), Subpixels(0.0), Subpixels(0.3)};
  });
  add("residual", [](optics::Rig& rig) {
    std::mt19937_64 random(5);
    rig.sheet.residual = test::random_residual(random, 2, 2, 0.04);
  });
  return rigs;
}

inline SceneDescription scene_of(std::vector<TriangleMesh> meshes) {
  SceneDescription scene;
  scene.materials = {Material{}};
  scene.meshes = std::move(meshes);
  return scene;
}
inline TriangleMesh triangle(Vec3 a, Vec3 b, Vec3 c) {
  TriangleMesh mesh;
  mesh.positions = {a, b, c};
  mesh.triangles = {{0, 1, 2}};
  return mesh;
}
/// Returns a stage whose world units are millimetres of the panel.
inline Stage plain_stage() { return test::make_tiny_stage({.mm_per_unit = 1.0}); }

}  // namespace lenticule::render
