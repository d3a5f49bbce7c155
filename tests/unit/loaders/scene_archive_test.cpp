// SPDX-License-Identifier: Apache-2.0
// Tests the archive in which a process without rights passes a scene on.
#include "render/loaders/scene_archive.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cstring>
#include <functional>
#include <limits>

#include "render/loaders/load_scene.h"
#include "tests/support/archive_bytes.h"
#include "tests/support/error_matchers.h"

namespace lenticule::render {
namespace {

using test::archive_of;
using test::scene_of;

/// Returns a scene that has one of everything.
SceneDescription full_scene() {
  SceneDescription scene;
  scene.source = "scene.glb";
  scene.textures = {std::make_shared<const Texture>(
                        Texture{.width = 1, .height = 2, .codes = {1, 2, 3, 4, 5, 6, 7, 8}}),
                    std::make_shared<const Texture>(
                        Texture{.width = 1, .height = 1, .rgba = {0.5F, 1, 2, 3}, .name = "b"})};
  PbrMaterial pbr;
  pbr.clearcoat = 0.25;
  pbr.alpha_mode = PbrMaterial::AlphaMode::Mask;
  pbr.sheen_colour_texture = {.texture = 1, .uv_set = 1, .uv_map = {1, 2, 3, 4, 5, 6}};
  scene.materials = {{.name = "plain", .texture = 0},
                     {.pbr = std::make_shared<const PbrMaterial>(pbr)}};
  Deformation deformation{.targets = {{.positions = {{1, 0, 0}, {0, 1, 0}, {0, 0, 1}}}},
                          .skin = 0,
                          .joints_per_vertex = 1,
                          .joints = {0, 1, 0},
                          .weights = {1, 1, 1}};
  scene.meshes = {{.name = "skinned",
                   .material = 1,
                   .positions = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}},
                   .triangles = {{0, 1, 2}},
                   .normals = {{0, 0, 1}, {0, 0, 1}, {0, 0, 1}},
                   .uvs = {{0, 0}, {1, 0}, {0, 1}},
                   .colours = {{1, 0, 0, 1}, {0, 1, 0, 1}, {0, 0, 1, 1}},
                   .node = 1,
                   .deformation = std::make_shared<const Deformation>(deformation)}};
  scene.shapes = {std::make_shared<const TriangleMesh>(
      TriangleMesh{.positions = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}}, .triangles = {{0, 1, 2}}})};
  scene.meshes.push_back({.name = "often", .shape = 0, .place = {.origin = {1, 2, 3}}});
  scene.spheres = {{.centre = {1, 2, 3}, .radius = 0.5, .inward = true}};
  scene.cones = {{.base = {}, .apex = {0, 1, 0}}};
  scene.lights = {{.kind = Light::Kind::Spot, .falls_off = true, .node = 0}};
  scene.cameras = {{.name = "front", .from = {0, 0, 5}, .node = 1}};
  Node root{.name = "root", .animated = true};
  root.translations = {.times = {0, 1}, .values = {{0, 0, 0}, {1, 0, 0}}, .steps = true};
  root.rotations = {.times = {0, 2},
                    .values = {{0, 0, 0, 1}, {0, 1, 0, 0}},
                    .in_tangents = {{}, {}},
                    .out_tangents = {{}, {}}};
  Node arm{.name = "arm", .parent = 0, .morph_weights = {0.5}};
  arm.morph_weight_keys = {.times = {0, 1}, .values = {{0}, {1}}};
  scene.nodes = {root, arm};
  scene.skins = {{.joints = {0, 1}, .joint_from_mesh = {{}, {}}}};
  scene.ambient = Vec3{0.1, 0.2, 0.3};
  scene.lit_by_studio = true;
  scene.duration_seconds = 2;
  scene.notes = {"one note", "another"};
  return scene;
}

TEST(SceneArchive, HasEveryMemberOfAScene) {
  const std::vector<uint8_t> bytes = archive_of(full_scene());
  const SceneDescription read = scene_of(bytes);
  EXPECT_EQ(archive_of(read), bytes);
  EXPECT_EQ(read.textures.at(1)->rgba, (std::vector<float>{0.5F, 1, 2, 3}));
  EXPECT_EQ(read.materials.at(1).pbr->clearcoat, 0.25);
  EXPECT_EQ(read.materials.at(1).pbr->alpha_mode, PbrMaterial::AlphaMode::Mask);
  EXPECT_EQ(read.materials.at(1).pbr->sheen_colour_texture.uv_map[5], 6);
  EXPECT_EQ(read.meshes.at(0).deformation->joints, (std::vector<uint16_t>{0, 1, 0}));
  EXPECT_EQ(read.meshes.at(0).triangles, full_scene().meshes.at(0).triangles);
  EXPECT_TRUE(read.spheres.at(0).inward);
  EXPECT_EQ(read.lights.at(0).kind, Light::Kind::Spot);
  EXPECT_EQ(read.nodes.at(1).morph_weight_keys.values.at(1), (std::vector<double>{1}));
  EXPECT_EQ(read.ambient, (Vec3{0.1, 0.2, 0.3}));
  EXPECT_EQ(read.notes.at(1), "another");
}

TEST(SceneArchive, PiecesOfAnySizeGiveTheSameScene) {
  const std::vector<uint8_t> bytes = archive_of(full_scene());
  for (const size_t piece : {1, 7, 8, 1000}) {
    EXPECT_EQ(archive_of(scene_of(bytes, piece)), bytes) << piece;
    EXPECT_EQ(archive_of(full_scene(), piece), bytes) << piece;
  }
}

TEST(SceneArchive, EveryTruncationIsRefused) {
  const std::vector<uint8_t> bytes = archive_of(full_scene());
  for (size_t size = 0; size < bytes.size(); ++size)
    EXPECT_EQ(test::error_of([&] { (void)scene_of(std::span(bytes).first(size)); }).kind(),
              ErrorKind::Input)
        << size;
}

TEST(SceneArchive, AFalseCountCostsNoMemory) {
  SceneDescription scene;
  std::vector<uint8_t> bytes = archive_of(scene);
  for (const uint64_t count : {uint64_t{1} << 34, uint64_t{1} << 40, ~uint64_t{0}}) {
    std::memcpy(bytes.data(), &count,
                sizeof count);  // of the characters of SceneDescription::source
    EXPECT_EQ(test::error_of([&] { (void)scene_of(bytes); }).kind(), ErrorKind::Input) << count;
  }
}

TEST(SceneArchive, RefusesIndicesAndCountsThatFitNothing) {
  const std::vector<std::pair<const char*, std::function<void(SceneDescription&)>>> kWrong = {
      {"vertex", [](auto& s) { s.meshes[0].triangles[0][1] = 3; }},
      {"normals", [](auto& s) { s.meshes[0].normals.pop_back(); }},
      {"texture coordinates", [](auto& s) { s.meshes[0].uvs.pop_back(); }},
      {"colours", [](auto& s) { s.meshes[0].colours.pop_back(); }},
      {"material", [](auto& s) { s.meshes[0].material = 2; }},
      {"material", [](auto& s) { s.spheres[0].material = -1; }},
      {"material", [](auto& s) { s.cones[0].material = std::numeric_limits<int>::max(); }},
      {"node", [](auto& s) { s.meshes[0].node = 2; }},
      {"shape", [](auto& s) { s.meshes[1].shape = 1; }},
      {"shape", [](auto& s) { s.shapes[0] = nullptr; }},
      {"copies", [](auto& s) { s.meshes[1].deformation = std::make_shared<const Deformation>(); }},
      {"choice",
       [](auto& s) {
         s.variants = {{"red"}, 1};
       }},
      {"choice", [](auto& s) { s.animations.taken = 0; }},
      {"node", [](auto& s) { s.lights[0].node = -2; }},
      {"node", [](auto& s) { s.cameras[0].node = 2; }},
      {"node", [](auto& s) { s.nodes[0].parent = 0; }},
      {"node", [](auto& s) { s.skins[0].joints[0] = -1; }},
      {"node", [](auto& s) { s.skins[0].joints[1] = 2; }},
      {"joints", [](auto& s) { s.skins[0].joint_from_mesh.pop_back(); }},
      {"texture", [](auto& s) { s.materials[0].texture = 2; }},
      {"texture", [](auto& s) { s.textures[0] = nullptr; }},
      {"key frames", [](auto& s) { s.nodes[0].translations.values.pop_back(); }},
      {"key frames", [](auto& s) { s.nodes[0].rotations.in_tangents.pop_back(); }},
      {"key frames", [](auto& s) { s.nodes[0].rotations.out_tangents.clear(); }},
      {"key frames",
       [](auto& s) {
         s.nodes[0].translations.times = {1, 0};
       }},
      {"weights",
       [](auto& s) {
         s.nodes[1].morph_weight_keys.values[1] = {1, 2};
       }},
      {"duration", [](auto& s) { s.duration_seconds = std::numeric_limits<double>::quiet_NaN(); }},
  };
  for (const auto& [what, break_it] : kWrong) {
    SceneDescription scene = full_scene();
    break_it(scene);
    test::expect_error(test::error_of([&] { (void)scene_of(archive_of(scene)); }), ErrorKind::Input,
                       what);
  }
  const std::vector<std::pair<const char*, std::function<void(Deformation&)>>> kWrongSkins = {
      {"skin", [](auto& d) { d.skin = 1; }},
      {"joint", [](auto& d) { d.joints[1] = 2; }},
      {"joints", [](auto& d) { d.weights.pop_back(); }},
      {"joints", [](auto& d) { d.joints_per_vertex = size_t{1} << 63; }},
      {"moves", [](auto& d) { d.targets[0].positions.pop_back(); }}};
  for (const auto& [what, break_it] : kWrongSkins) {
    SceneDescription scene = full_scene();
    Deformation deformation = *scene.meshes[0].deformation;
    break_it(deformation);
    scene.meshes[0].deformation = std::make_shared<const Deformation>(deformation);
    test::expect_error(test::error_of([&] { (void)scene_of(archive_of(scene)); }), ErrorKind::Input,
                       what);
  }
  for (const Texture& wrong :
       {Texture{.width = 0, .height = 1}, Texture{.width = 40'000, .height = 1},
        Texture{.width = 1, .height = 1, .codes = {1, 2, 3}},
        Texture{.width = 1, .height = 1, .codes = {1, 2, 3, 4}, .held = 0}}) {
    SceneDescription scene = full_scene();
    scene.textures[0] = std::make_shared<const Texture>(wrong);
    test::expect_error(test::error_of([&] { (void)scene_of(archive_of(scene)); }), ErrorKind::Input,
                       "tex");
  }
}

}  // namespace
}  // namespace lenticule::render
