// SPDX-License-Identifier: Apache-2.0
// Tests total internal reflection and nested transparent objects against Snell's law in long
// double.
#include "apps/lenticule-bench/stability/oracle_picture.h"
#include "apps/lenticule-bench/stability/small_scenes.h"

namespace lenticule::bench {
namespace {

render::Material glass(double index) {
  return {.name = "glass",
          .colour = {0.95, 0.9, 0.85},
          .diffuse = 0.0,
          .specular = 0.11,
          .transmittance = 0.84,
          .refraction_index = index};
}

/// Adds stripes of three glowing materials behind everything, which reveal the direction of a
/// refracted ray.
void add_stripes(render::SceneDescription& scene) {
  const int first = static_cast<int>(scene.materials.size());
  scene.materials.push_back(glowing({0.8, 0.3, 0.1}));
  scene.materials.push_back(glowing({0.1, 0.7, 0.4}));
  scene.materials.push_back(glowing({0.3, 0.2, 0.9}));
  for (int k = 0; k < 9; ++k) {
    render::TriangleMesh stripe =
        grid_mesh({-63.1 + 14.0 * k, -41.3, -33.7}, {14.0, 0.0, 1.3}, {0.7, 83.1, -2.1}, 1);
    stripe.material = first + k % 3;
    scene.meshes.push_back(stripe);
  }
}

optics::Rig rig_of(const StabilitySize& size) {
  return finer(small_rig(), size.full ? 4 : 1);
}

/// Returns a box rotated about two axes, so that rays meet its far faces beyond the critical angle.
render::TriangleMesh turned_box() {
  render::TriangleMesh box = box_mesh({-14.1, -11.3, -9.7}, {13.3, 12.1, 10.9}, 0);
  for (Vec3& p : box.positions) {
    p = {0.8 * p.x - 0.6 * p.z, p.y, 0.6 * p.x + 0.8 * p.z};
    p = {p.x - 17.3, 0.96 * p.y - 0.28 * p.z, 0.28 * p.y + 0.96 * p.z};
  }
  return box;
}

}  // namespace

StabilityRow stability_total_reflection(const StabilitySize& size) {
  render::SceneDescription scene = dark_scene({0.2, 0.25, 0.3});
  scene.materials = {glass(1.52), glass(2.42)};
  scene.meshes = {turned_box()};
  scene.spheres = {{.centre = {19.7, 1.3, 2.1}, .radius = 14.9, .material = 1}};
  add_stripes(scene);
  StabilityRow row = compare_with_oracle(scene, rig_of(size), size);
  row.stressed = "a rotated box of glass and a ball of diamond: total internal reflection";
  return row;
}

StabilityRow stability_nested_glass(const StabilitySize& size) {
  render::SceneDescription scene = dark_scene({0.2, 0.25, 0.3});
  scene.materials = {glass(1.5), glass(2.0)};
  // A glass ball that contains a bubble, which contains a ball of denser glass; and beside it the
  // same with an air gap so thin that the surfaces nearly touch.
  scene.spheres = {{.centre = {-19.3, 0.7, 1.1}, .radius = 17.3, .material = 0},
                   {.centre = {-18.1, 1.9, 2.3}, .radius = 11.9, .inward = true, .material = 0},
                   {.centre = {-17.3, 2.3, 3.1}, .radius = 7.1, .material = 1},
                   {.centre = {19.1, -0.9, 1.7}, .radius = 16.7, .material = 0},
                   {.centre = {19.1, -0.9, 1.7}, .radius = 12.001, .inward = true, .material = 0},
                   {.centre = {19.1, -0.9, 1.7}, .radius = 12.0, .material = 1}};
  add_stripes(scene);
  StabilityRow row = compare_with_oracle(scene, rig_of(size), size);
  row.stressed = "glass in bubbles in glass, one a thousandth of a millimetre thin";
  return row;
}

}  // namespace lenticule::bench
