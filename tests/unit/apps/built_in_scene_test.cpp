// SPDX-License-Identifier: Apache-2.0
// Tests that a built-in scene and the NFF file written from it are the same scene.
#include <gtest/gtest.h>

#include <tuple>

#include "apps/lenticule-tools/offline/scene_sequence.h"
#include "render/loaders/nff.h"

namespace lenticule::tools {
namespace {

auto fields_of(const render::Material& m) {
  return std::tie(m.name, m.colour, m.diffuse, m.specular, m.shine, m.transmittance,
                  m.refraction_index, m.tinted_specular, m.two_sided);
}
auto fields_of(const render::TriangleMesh& m) {
  return std::tie(m.name, m.material, m.positions, m.triangles, m.normals);
}
auto fields_of(const render::Sphere& s) {
  return std::tie(s.centre, s.radius, s.inward, s.material);
}
auto fields_of(const render::Cone& c) {
  return std::tie(c.base, c.base_radius, c.apex, c.apex_radius, c.inward, c.material);
}
auto fields_of(const render::Light& l) { return std::tie(l.position, l.colour); }
auto fields_of(const render::Camera& c) {
  return std::tie(c.name, c.from, c.at, c.up, c.vertical_fov_degrees, c.hither);
}

/// Compares all of `text` with the first things of `whole`; textured meshes come after those.
template <class Object>
void expect_begins_with(const std::vector<Object>& whole, const std::vector<Object>& text,
                        size_t others) {
  ASSERT_EQ(whole.size(), text.size() + others);
  for (size_t k = 0; k < text.size(); ++k)
    EXPECT_TRUE(fields_of(whole[k]) == fields_of(text[k])) << k;
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
