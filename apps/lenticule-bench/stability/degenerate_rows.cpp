// SPDX-License-Identifier: Apache-2.0
// Tests degenerate geometry: values that are not finite are refused with a clear error, and
// primitives without area change nothing. A run that ends by a signal here has failed too.
#include <fmt/format.h>
#include <unistd.h>

#include <algorithm>
#include <filesystem>
#include <fstream>
#include <functional>
#include <limits>

#include "apps/lenticule-bench/stability/rows.h"
#include "apps/lenticule-bench/stability/small_scenes.h"
#include "apps/lenticule-bench/stability/tally.h"
#include "base/error.h"
#include "render/loaders/load_scene.h"

namespace lenticule::bench {
namespace {

using render::SceneDescription;

constexpr double kNan = std::numeric_limits<double>::quiet_NaN();
constexpr double kInfinity = std::numeric_limits<double>::infinity();

/// Returns true if the attempt throws an Error with a subject and a cause.
bool refuses(const std::function<void()>& attempt) {
  try {
    attempt();
  } catch (const Error& error) {
    return error.kind() == ErrorKind::Input &&
           std::string(error.what()).find(": ") != std::string::npos;
  }
  return false;
}

SceneDescription ball_scene() {
  SceneDescription scene = dark_scene({0.1, 0.2, 0.3});
  scene.materials = {glowing({0.7, 0.5, 0.4}), glowing({0.2, 0.9, 0.6})};
  scene.meshes = {ball_mesh({1.1, 0.3, 0.7}, 17.3, 12)};
  return scene;
}

void refuse_values(double bad, NamedFailures& failures) {
  const auto expect = [&](const char* name, const std::function<void(SceneDescription&)>& spoil) {
    SceneDescription scene = ball_scene();
    spoil(scene);
    failures.check(fmt::format("{} {}", name, bad),
                   refuses([&] { (void)render_small(scene, plain_stage(), small_rig(), 1); }));
  };
  expect("vertex", [&](auto& s) { s.meshes[0].positions[7].y = bad; });
  expect("unused vertex", [&](auto& s) { s.meshes[0].positions.push_back({bad, 0, 0}); });
  expect("normal", [&](auto& s) {
    s.meshes[0].normals.assign(s.meshes[0].positions.size(), {0, 1, 0});
    s.meshes[0].normals[3].z = bad;
  });
  expect("sphere's centre", [&](auto& s) { s.spheres = {{.centre = {bad, 0, 0}}}; });
  expect("sphere's radius", [&](auto& s) { s.spheres = {{.radius = bad}}; });
  expect("cone's base", [&](auto& s) { s.cones = {{.base = {0, bad, 0}, .apex = {1, 2, 3}}}; });
  expect("cone's radius", [&](auto& s) { s.cones = {{.base_radius = bad, .apex = {1, 2, 3}}}; });
  expect("colour", [&](auto& s) { s.materials[0].colour.x = bad; });
  expect("index of refraction", [&](auto& s) { s.materials[0].refraction_index = bad; });
  expect("ambient light", [&](auto& s) { s.ambient = Vec3{0, bad, 0}; });
  expect("lamp", [&](auto& s) {
    render::Light light;
    light.position = {0, 0, bad};
    s.lights = {light};
  });
}

void refuse_shapes(NamedFailures& failures) {
  const auto expect = [&](const char* name, const std::function<void(SceneDescription&)>& spoil) {
    SceneDescription scene = ball_scene();
    spoil(scene);
    failures.check(name,
                   refuses([&] { (void)render_small(scene, plain_stage(), small_rig(), 1); }));
  };
  expect("vertex at 1e30", [](auto& s) { s.meshes[0].positions[7].y = 1e30; });
  expect("missing vertex", [](auto& s) { s.meshes[0].triangles[5][1] = 1U << 30U; });
  expect("missing material", [](auto& s) { s.meshes[0].material = 7; });
  expect("negative radius", [](auto& s) { s.spheres = {{.radius = -1.0}}; });
  expect("cone without height", [](auto& s) {
    s.cones = {{.base = {1, 1, 1}, .apex = {1, 1, 1}}};
  });
}

/// Adds triangles without area, slivers thinner than any number on the panel, and duplicates of
/// them.
void add_nothing(SceneDescription& scene) {
  render::TriangleMesh nothing;
  nothing.name = "nothing";
  nothing.material = 1;
  nothing.positions = {{-30, -20, 30},         {30, 20, 30},       {0, 0, 30},
                       {-30, -20 + 1e-30, 30}, {3e-39, 1e-40, 25}, {0, 2e-40, 25}};
  for (int again = 0; again < 50; ++again)
    nothing.triangles.insert(nothing.triangles.end(),
                             {{0, 0, 0}, {0, 0, 1}, {0, 1, 1}, {0, 1, 2}, {0, 1, 3}, {2, 4, 5}});
  scene.meshes.push_back(nothing);
  const auto triangles = scene.meshes[0].triangles;
  for (int again = 0; again < 3; ++again)
    scene.meshes[0].triangles.insert(scene.meshes[0].triangles.end(), triangles.begin(),
                                     triangles.end());
}

void compare_with_clean(NamedFailures& failures) {
  SceneDescription scene = ball_scene();
  const frames::WovenFrame clean = render_small(scene, plain_stage(), small_rig(), 1);
  add_nothing(scene);
  const frames::WovenFrame littered = render_small(scene, plain_stage(), small_rig(), 1);
  failures.check("picture with degenerate triangles",
                 std::ranges::equal(clean.bytes(), littered.bytes()));
  scene = ball_scene();
  scene.meshes[0].normals.assign(scene.meshes[0].positions.size(), Vec3{});
  const frames::WovenFrame without = render_small(scene, plain_stage(), small_rig(), 1);
  failures.check("picture with normals of length zero",
                 std::ranges::equal(clean.bytes(), without.bytes()));
}

/// Files tests that broken files cause an error with the file's name, or a note about a repair.
class Files {
 public:
  Files()
      : folder_(std::filesystem::temp_directory_path() /
                fmt::format("lenticule-stability-{}", getpid())) {
    std::filesystem::create_directories(folder_);
  }
  ~Files() {
    std::error_code ignored;
    std::filesystem::remove_all(folder_, ignored);
  }
  Files(const Files&) = delete;
  Files& operator=(const Files&) = delete;

  SceneDescription load(const char* name, const char* text) const {
    std::ofstream(folder_ / name) << text;
    return render::load_scene(folder_ / name);
  }

 private:
  std::filesystem::path folder_;
};

void load_files(NamedFailures& failures) {
  const Files files;
  const auto refused = [&](const char* name, const char* text) {
    failures.check(name, refuses([&] { (void)files.load(name, text); }));
  };
  refused("nan.obj", "v nan 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n");
  refused("inf.obj", "v inf 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n");
  refused("nan.nff", "f 1 1 1 1 0 0 0 1\np 3\nnan 0 0\n1 0 0\n0 1 0\n");
  refused("huge.nff", "f 1 1 1 1 0 0 0 1\ns 0 0 0 1e999\n");
  const auto noted = [&](const char* name, const char* text) {
    bool good = false;
    try {
      good = !files.load(name, text).notes.empty();
    } catch (const Error& error) {
      good = error.kind() == ErrorKind::Input;
    }
    failures.check(name, good);
  };
  noted("flat.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 2 0 0\nf 1 2 3\nf 1 2 4\nf 1 1 2\n");
  noted("flat.nff", "f 1 1 1 1 0 0 0 1\np 3\n0 0 0\n1 0 0\n0 1 0\np 3\n0 0 0\n1 0 0\n2 0 0\n");
  noted("normal.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nvn 0 0 0\nvn nan 0 0\nf 1//1 2//2 3//1\n");
}

}  // namespace

StabilityRow stability_degenerate(const StabilitySize&) {
  NamedFailures failures;
  for (const double bad : {kNan, kInfinity, -kInfinity}) refuse_values(bad, failures);
  refuse_shapes(failures);
  compare_with_clean(failures);
  load_files(failures);
  return {.stressed = "NaN, infinity, 1e30, missing corners; slivers, duplicates, no area; files",
          .samples = failures.tally.samples,
          .samples_are = "cases",
          .failures = failures.tally.failures,
          .failures_are = "neither refused nor harmless",
          .note = failures.names()};
}

}  // namespace lenticule::bench
