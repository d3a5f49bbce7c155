// SPDX-License-Identifier: Apache-2.0
// Tests that a built-in scene and the NFF file written from it are the same scene.
#include <gtest/gtest.h>

#include "apps/lenticule-tools/offline/scene_sequence.h"
#include "render/loaders/nff.h"

namespace lenticule::tools {
namespace {

void expect_same(const render::Material& a, const render::Material& b) {
  EXPECT_EQ(a.name, b.name);
  EXPECT_EQ(a.colour, b.colour);
  EXPECT_EQ(a.diffuse, b.diffuse);
  EXPECT_EQ(a.specular, b.specular);
  EXPECT_EQ(a.shine, b.shine);
  EXPECT_EQ(a.transmittance, b.transmittance);
  EXPECT_EQ(a.refraction_index, b.refraction_index);
  EXPECT_EQ(a.tinted_specular, b.tinted_specular);
  EXPECT_EQ(a.two_sided, b.two_sided);
}

void expect_same(const render::TriangleMesh& a, const render::TriangleMesh& b) {
  EXPECT_EQ(a.name, b.name);
  EXPECT_EQ(a.material, b.material);
  EXPECT_EQ(a.positions, b.positions);
  EXPECT_EQ(a.triangles, b.triangles);
  EXPECT_EQ(a.normals, b.normals);
}

void expect_same(const render::Sphere& a, const render::Sphere& b) {
  EXPECT_EQ(a.centre, b.centre);
  EXPECT_EQ(a.radius, b.radius);
  EXPECT_EQ(a.inward, b.inward);
  EXPECT_EQ(a.material, b.material);
}

void expect_same(const render::Cone& a, const render::Cone& b) {
  EXPECT_EQ(a.base, b.base);
  EXPECT_EQ(a.base_radius, b.base_radius);
  EXPECT_EQ(a.apex, b.apex);
  EXPECT_EQ(a.apex_radius, b.apex_radius);
  EXPECT_EQ(a.inward, b.inward);
  EXPECT_EQ(a.material, b.material);
}

void expect_same(const render::Light& a, const render::Light& b) {
  EXPECT_EQ(a.position, b.position);
  EXPECT_EQ(a.colour, b.colour);
}

void expect_same(const render::Camera& a, const render::Camera& b) {
  EXPECT_EQ(a.name, b.name);
  EXPECT_EQ(a.from, b.from);
  EXPECT_EQ(a.at, b.at);
  EXPECT_EQ(a.up, b.up);
  EXPECT_EQ(a.vertical_fov_degrees, b.vertical_fov_degrees);
  EXPECT_EQ(a.hither, b.hither);
}

/// Compares all of `text` with the first things of `whole`; textured meshes come after those.
template <class Object>
void expect_begins_with(const std::vector<Object>& whole, const std::vector<Object>& text,
                        size_t others) {
  ASSERT_EQ(whole.size(), text.size() + others);
  for (size_t k = 0; k < text.size(); ++k) expect_same(whole[k], text[k]);
}

TEST(BuiltInScene, IsTheSceneOfItsNffText) {
  for (const scenes::BuiltInScene& scene : scenes::scene_list()) {
    SCOPED_TRACE(scene.name);
    const scenes::SceneParts parts = scenes::build_scene(scene, 2, 5);
    const render::SceneDescription whole = describe_built_in(scene, 2, 5);
    const std::string source = std::string("builtin:") + scene.name;
    const render::SceneDescription text = render::parse_nff(scenes::nff_text(parts), source);
    EXPECT_EQ(whole.source, text.source);
    expect_begins_with(whole.materials, text.materials, parts.pictured.size());
    expect_begins_with(whole.meshes, text.meshes, parts.pictured.size());
    expect_begins_with(whole.spheres, text.spheres, 0);
    expect_begins_with(whole.cones, text.cones, 0);
    expect_begins_with(whole.lights, text.lights, 0);
    expect_begins_with(whole.cameras, text.cameras, 0);
    EXPECT_EQ(whole.background, text.background);
    EXPECT_EQ(whole.ambient, text.ambient);
    EXPECT_EQ(whole.colour_managed, text.colour_managed);
    EXPECT_EQ(whole.notes, text.notes);
  }
}

}  // namespace
}  // namespace lenticule::tools
