// SPDX-License-Identifier: Apache-2.0
// Features of glTF: nodes, cameras and lights, and what moves them.
#include <cmath>
#include <numbers>

#include "tests/unit/loaders/gltf_features.h"

namespace lenticule::render {
namespace {

using ::testing::Contains;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::SizeIs;
using namespace lenticule::test;

std::vector<float> matrix_moved_by(float x) {
  return {1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, x, 0, 0, 1};
}

/// Gives the quad two joints: the left vertices follow the first, the right ones the second.
void add_skin(GltfModel& model) {
  const int first = model.add_node({{"name", "first"}});
  const int second = model.add_node({{"name", "second"}, {"translation", {5, 0, 0}}});
  std::vector<float> matrices = matrix_moved_by(0);
  const std::vector<float> inverse = matrix_moved_by(-5);
  matrices.insert(matrices.end(), inverse.begin(), inverse.end());
  model.json["skins"] = {{{"joints", {first, second}},
                          {"inverseBindMatrices", model.add_accessor(matrices, "MAT4", kFloat)}}};
  model.attributes()["JOINTS_0"] = model.add_accessor(
      std::vector<uint8_t>{0, 0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0, 0, 0, 0, 0}, "VEC4", kUbyte);
  model.attributes()["WEIGHTS_0"] = model.add_accessor(
      std::vector<float>{1, 0, 0, 0, 1, 0, 0, 0, 2, 0, 0, 0, 1, 0, 0, 0}, "VEC4", kFloat);
  model.node()["skin"] = 0;
}

void add_morph_targets(GltfModel& model) {
  const int up =
      model.add_accessor(std::vector<float>{0, 0, 0, 0, 0, 0, 0, 2, 0, 0, 2, 0}, "VEC3", kFloat);
  const int out =
      model.add_accessor(std::vector<float>{0, 0, 1, 0, 0, 1, 0, 0, 1, 0, 0, 1}, "VEC3", kFloat);
  model.primitive()["targets"] = {{{"POSITION", up}}, {{"POSITION", out}}};
}

}  // namespace

std::vector<GltfFeatureCase> gltf_node_features() {
  return {
      {"NodeMatrix",
       [](GltfModel& m) { m.node()["matrix"] = {2, 0, 0, 0, 0, 2, 0, 0, 0, 0, 2, 0, 5, 6, 7, 1}; },
       [](const SceneDescription& s) {
         expect_close(only_mesh(s).positions[2], {7, 8, 7});
       }},
      {"TranslationRotationScale",
       [](GltfModel& m) {
         m.node()["translation"] = {1, 2, 3};
         m.node()["rotation"] = {0, 0, std::sqrt(0.5), std::sqrt(0.5)};
         m.node()["scale"] = {2, 1, 1};
       },
       [](const SceneDescription& s) {
         expect_close(only_mesh(s).positions[1], {1, 4, 3});
         expect_close(only_mesh(s).positions[3], {0, 2, 3});
       }},
      {"NegativeScaleKeepsTheFrontSide",
       [](GltfModel& m) {
         m.node()["scale"] = {-1, 1, 1};
       },
       [](const SceneDescription& s) {
         expect_close(only_mesh(s).positions[1], {-1, 0, 0});
         expect_area(s, 1.0);
         expect_close(only_mesh(s).normals[0], {0, 0, 1});
       }},
      {"ChildrenFollowTheirParents",
       [](GltfModel& m) {
         const int parent = m.add_node({{"translation", {10, 0, 0}}, {"children", {0}}});
         m.json["scenes"][0]["nodes"] = {parent};
       },
       [](const SceneDescription& s) {
         expect_close(only_mesh(s).positions[0], {10, 0, 0});
       }},
      {"TheStatedSceneIsShown",
       [](GltfModel& m) {
         m.json["nodes"].push_back({{"mesh", 0}, {"translation", {3, 0, 0}}});
         m.json["scenes"].push_back({{"nodes", {1}}});
         m.json["scene"] = 1;
       },
       [](const SceneDescription& s) {
         expect_close(only_mesh(s).positions[0], {3, 0, 0});
         EXPECT_THAT(s.notes, Contains(HasSubstr("further scenes")));
       }},
      {"Instances",
       [](GltfModel& m) {
         m.require("EXT_mesh_gpu_instancing");
         const int at =
             m.add_accessor(std::vector<float>{0, 0, 0, 5, 0, 0, 0, 5, 0}, "VEC3", kFloat);
         const int scale =
             m.add_accessor(std::vector<float>{1, 1, 1, 2, 2, 2, 3, 3, 3}, "VEC3", kFloat);
         m.node()["extensions"]["EXT_mesh_gpu_instancing"]["attributes"] = {{"TRANSLATION", at},
                                                                            {"SCALE", scale}};
         m.node()["translation"] = {0, 0, 1};
       },
       [](const SceneDescription& s) {
         ASSERT_THAT(s.meshes, SizeIs(3));
         expect_close(s.meshes[1].positions[2], {7, 2, 1});
         expect_close(s.meshes[2].positions[2], {3, 8, 1});
       }},
      {"PerspectiveCamera",
       [](GltfModel& m) {
         m.json["cameras"] = {
             {{"type", "perspective"}, {"perspective", {{"yfov", 0.5}, {"znear", 0.25}}}}};
         m.add_node({{"camera", 0}, {"name", "view"}, {"translation", {0.5, 0.5, 4}}});
       },
       [](const SceneDescription& s) {
         ASSERT_THAT(s.cameras, SizeIs(1));
         EXPECT_EQ(s.cameras[0].name, "view");
         expect_close(s.cameras[0].from, {0.5, 0.5, 4});
         expect_close(s.cameras[0].at, {0.5, 0.5, 0});
         EXPECT_NEAR(s.cameras[0].vertical_fov_degrees, 0.5 * 180.0 / std::numbers::pi, 1e-9);
         EXPECT_EQ(s.cameras[0].hither, 0.25);
       }},
      {"OrthographicCamerasShowTheSameHeight",
       [](GltfModel& m) {
         m.json["cameras"] = {
             {{"type", "orthographic"},
              {"orthographic", {{"xmag", 2}, {"ymag", 3}, {"znear", 0}, {"zfar", 10}}}}};
         m.add_node({{"camera", 0}, {"name", "plan"}, {"translation", {0, 0, 4}}});
       },
       [](const SceneDescription& s) {
         ASSERT_THAT(s.cameras, SizeIs(1));
         const double half = s.cameras[0].vertical_fov_degrees / 2.0 * std::numbers::pi / 180.0;
         EXPECT_NEAR(4.0 * std::tan(half), 3.0, 1e-9);
         EXPECT_THAT(s.notes, Contains(HasSubstr("orthographic camera 'plan'")));
       }},
      {"Lights",
       [](GltfModel& m) {
         m.require("KHR_lights_punctual");
         m.json["extensions"]["KHR_lights_punctual"]["lights"] = {
             {{"type", "directional"}, {"intensity", 2}},
             {{"type", "point"}, {"color", {1, 0, 0}}, {"range", 5}},
             {{"type", "spot"}, {"spot", {{"innerConeAngle", 0.1}, {"outerConeAngle", 0.2}}}}};
         for (int i = 0; i < 3; ++i)
           m.add_node({{"translation", {0, 0, 2}},
                       {"extensions", {{"KHR_lights_punctual", {{"light", i}}}}}});
       },
       [](const SceneDescription& s) {
         ASSERT_THAT(s.lights, SizeIs(3));
         EXPECT_EQ(s.lights[0].kind, Light::Kind::Directional);
         expect_close(s.lights[0].direction, {0, 0, -1});
         EXPECT_NEAR(s.lights[0].colour.x, 2.0 * s.light_scale, 1e-9);
         EXPECT_LT(s.light_scale, 0.65);
         EXPECT_FALSE(s.lights[0].falls_off);
         EXPECT_EQ(s.lights[1].kind, Light::Kind::Point);
         EXPECT_EQ(s.lights[1].colour.y, 0.0);
         EXPECT_TRUE(s.lights[1].falls_off);
         expect_close(s.lights[2].position, {0, 0, 2});
         EXPECT_NEAR(s.lights[2].cos_inner, std::cos(0.1), 1e-9);
         EXPECT_NEAR(s.lights[2].cos_outer, std::cos(0.2), 1e-9);
         EXPECT_THAT(s.notes, Contains(HasSubstr("1 light ranges ignored")));
       }},
  };
}

std::vector<GltfFeatureCase> gltf_motion_features() {
  return {
      {"LinearKeys",
       [](GltfModel& m) {
         m.animate(0, "translation", {0, 2}, {0, 0, 0, 4, 0, 0}, "VEC3");
       },
       [](const SceneDescription& s) {
         EXPECT_EQ(s.duration_seconds, 2.0);
         expect_close(at_time(s, 0.5).meshes[0].positions[0], {1, 0, 0});
       }},
      {"SteppedKeys",
       [](GltfModel& m) {
         m.animate(0, "scale", {0, 1}, {1, 1, 1, 3, 3, 3}, "VEC3", "STEP");
       },
       [](const SceneDescription& s) {
         expect_close(at_time(s, 0.99).meshes[0].positions[2], {1, 1, 0});
         expect_close(at_time(s, 1.0).meshes[0].positions[2], {3, 3, 0});
       }},
      {"CubicSplines",
       [](GltfModel& m) {
         // The node moves from 0 to 1 in two seconds; its velocity is 3 at the start, 0 at the end.
         m.animate(0, "translation", {0, 2}, {0, 0, 0, 0, 0, 0, 3, 0, 0, 0, 0, 0, 1, 0, 0, 0, 0, 0},
                   "VEC3", "CUBICSPLINE");
       },
       [](const SceneDescription& s) {
         // Half way: 1/2 * 0 + 1/8 * 2 * 3 + 1/2 * 1 - 1/8 * 2 * 0.
         expect_close(at_time(s, 1.0).meshes[0].positions[0], {1.25, 0, 0});
         expect_close(at_time(s, 2.0).meshes[0].positions[0], {1, 0, 0});
       }},
      {"RotationKeys",
       [](GltfModel& m) {
         const float half = std::sqrt(0.5F);
         m.animate(0, "rotation", {0, 1}, {0, 0, 0, 1, 0, 0, half, half}, "VEC4");
       },
       [](const SceneDescription& s) {
         const double c = std::sqrt(0.5);
         expect_close(at_time(s, 0.5).meshes[0].positions[1], {c, c, 0});
       }},
      {"NormalizedRotationKeys",
       [](GltfModel& m) {
         m.animate(0, "rotation", {0, 1}, {0, 0, 0, 1, 0, 0, 1, 0}, "VEC4");
         m.json["animations"][0]["samplers"][0]["output"] =
             m.add_accessor(std::vector<int16_t>{0, 0, 0, 32767, 0, 0, 32767, 0}, "VEC4", kShort,
                            {{"normalized", true}});
       },
       [](const SceneDescription& s) {
         expect_close(at_time(s, 1.0).meshes[0].positions[1], {-1, 0, 0});
       }},
      {"SeveralAnimationsAreNoted",
       [](GltfModel& m) {
         m.animate(0, "translation", {0, 1}, {0, 0, 0, 1, 0, 0}, "VEC3");
         m.json["animations"].push_back(m.json["animations"][0]);
       },
       [](const SceneDescription& s) {
         EXPECT_THAT(s.notes, Contains("2 animations, the first is played"));
       }},
      {"MorphTargetsWithTheMeshsWeights",
       [](GltfModel& m) {
         add_morph_targets(m);
         m.json["meshes"][0]["weights"] = {0.5, 1};
       },
       [](const SceneDescription& s) {
         EXPECT_THAT(s.nodes, IsEmpty());
         expect_close(only_mesh(s).positions[1], {1, 0, 1});
         expect_close(only_mesh(s).positions[2], {1, 2, 1});
       }},
      {"MorphTargetsWithTheNodesWeights",
       [](GltfModel& m) {
         add_morph_targets(m);
         m.json["meshes"][0]["weights"] = {0.5, 1};
         m.node()["weights"] = {0, 2};
       },
       [](const SceneDescription& s) {
         expect_close(only_mesh(s).positions[2], {1, 1, 2});
       }},
      {"AnimatedMorphWeights",
       [](GltfModel& m) {
         add_morph_targets(m);
         m.animate(0, "weights", {0, 1}, {0, 0, 1, 0.5F}, "SCALAR");
       },
       [](const SceneDescription& s) {
         expect_close(at_time(s, 0.0).meshes[0].positions[2], {1, 1, 0});
         expect_close(at_time(s, 0.5).meshes[0].positions[2], {1, 2, 0.25});
       }},
      {"Skin", add_skin,
       [](const SceneDescription& s) {
         EXPECT_THAT(s.nodes, IsEmpty()) << "nothing moves";
         expect_quad(s);
       }},
      {"AnimatedSkin",
       [](GltfModel& m) {
         add_skin(m);
         m.node()["translation"] = {100, 0, 0};  // does not move a skinned mesh
         m.animate(2, "translation", {0, 1}, {5, 0, 0, 6, 0, 0}, "VEC3");
       },
       [](const SceneDescription& s) {
         const SceneDescription moved = at_time(s, 1.0);
         expect_close(moved.meshes[0].positions[0], {0, 0, 0});
         expect_close(moved.meshes[0].positions[1], {2, 0, 0});
         expect_close(moved.meshes[0].positions[2], {2, 1, 0});
       }},
      {"AMorphedTriangleMayStartWithoutAnArea",
       [](GltfModel& m) {
         m.attributes()["POSITION"] =
             m.add_accessor(std::vector<float>{0, 0, 0, 1, 0, 0, 1, 0, 0, 0, 0, 0}, "VEC3", kFloat);
         add_morph_targets(m);
         m.animate(0, "weights", {0, 1}, {0, 0, 0.5F, 0}, "SCALAR");
       },
       [](const SceneDescription& s) { expect_area(at_time(s, 1.0), 1.0); }},
  };
}

}  // namespace lenticule::render
