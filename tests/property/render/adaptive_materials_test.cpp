// SPDX-License-Identifier: Apache-2.0
// Tests method adaptive against method full on random scenes with metallic-roughness materials:
// mirrors, highlights, normal maps, cut out and blended surfaces, glass, lights.
#include <gtest/gtest.h>

#include <cmath>
#include <cstdlib>
#include <memory>
#include <random>

#include "render/methods/adaptive/audit.h"
#include "render/methods/method.h"
#include "tests/support/instruction_sets.h"
#include "tests/support/tiny_scenes.h"

namespace lenticule::render {
namespace {

using test::make_rig;
using test::make_tiny_stage;

constexpr int kScenes = 12;

/// Random makes scenes; the same seed gives the same scene.
class Random {
 public:
  explicit Random(int seed) : engine_(static_cast<uint64_t>(seed)) {}

  double in(double low, double high) {
    return std::uniform_real_distribution<double>(low, high)(engine_);
  }
  bool one_in(int n) { return std::uniform_int_distribution<int>(1, n)(engine_) == 1; }
  Vec3 point(double size) { return {in(-size, size), in(-size, size), in(-size, size)}; }

  SceneDescription scene() {
    SceneDescription scene;
    scene.source = "random";
    add_sheet(scene, {-4, -3, -2.5}, {8, 0, 0}, {0, 6, 0});
    for (int n = 0; n < 7; ++n) add_object(scene);
    const int lights = std::uniform_int_distribution<int>(0, 2)(engine_);
    if (lights > 0) scene.ambient = Vec3{0.2, 0.2, 0.2};
    for (int n = 0; n < lights; ++n)
      scene.lights.push_back(
          {.position = {in(-8, 8), in(2, 9), in(4, 9)}, .colour = Vec3{1, 1, 1} * in(0.3, 0.8)});
    return scene;
  }

 private:
  void add_sheet(SceneDescription& scene, Vec3 corner, Vec3 a, Vec3 b) {
    TriangleMesh sheet = test::rectangle_mesh(corner, a, b, add_material(scene));
    sheet.uvs = {{0, 0}, {1, 0}, {1, 1}, {0, 1}};
    scene.meshes.push_back(sheet);
  }

  void add_object(SceneDescription& scene) {
    const Vec3 centre = point(2.0);
    const double size = in(0.3, 1.2);
    switch (std::uniform_int_distribution<int>(0, 3)(engine_)) {
      case 0:
        return add_sheet(scene, centre, {in(1, 3), 0, in(-0.5, 0.5)}, {0, in(1, 2), in(-0.5, 0.5)});
      case 1:
        scene.spheres.push_back(
            {.centre = centre, .radius = size, .material = add_material(scene)});
        return;
      case 2:
        scene.meshes.push_back(test::box_mesh(
            centre - Vec3{size, size, size}, centre + Vec3{size, size, size}, add_material(scene)));
        return;
      default:
        scene.meshes.push_back(test::ball_mesh(centre, size, 14, add_material(scene)));
    }
  }

  int add_material(SceneDescription& scene) {
    PbrMaterial m;
    m.base_colour = {in(0.1, 1), in(0.1, 1), in(0.1, 1)};
    m.metallic = one_in(3) ? 1.0 : 0.0;
    m.roughness = in(0.05, 1.0);
    m.double_sided = one_in(2);
    m.unlit = one_in(8);
    if (one_in(3)) m.base_colour_texture.texture = add_texture(scene, one_in(2));
    if (one_in(4)) m.normal_texture.texture = add_texture(scene, false);
    m.clearcoat = one_in(5) ? 1.0 : 0.0;
    if (one_in(6)) m.sheen_colour = {0.6, 0.5, 0.7};
    if (one_in(5)) {
      m.transmission = in(0.3, 1.0);
      m.thickness = one_in(2) ? 1.0 : 0.0;
    }
    using enum PbrMaterial::AlphaMode;
    if (one_in(4)) {
      m.alpha_mode = one_in(2) ? Mask : Blend;
      m.alpha = m.alpha_mode == Blend ? in(0.2, 0.9) : 1.0;
    }
    scene.materials.push_back({.name = "m", .pbr = std::make_shared<PbrMaterial>(m)});
    return static_cast<int>(scene.materials.size()) - 1;
  }

  int add_texture(SceneDescription& scene, bool with_holes) {
    auto texture = std::make_shared<Texture>();
    texture->width = texture->height = 16;
    for (int n = 0; n < 16 * 16; ++n) {
      for (int c = 0; c < 3; ++c) texture->rgba.push_back(static_cast<float>(in(0.4, 0.7)));
      texture->rgba.push_back(with_holes && one_in(4) ? 0.0F : 1.0F);
    }
    scene.textures.push_back(texture);
    return static_cast<int>(scene.textures.size()) - 1;
  }

  std::mt19937_64 engine_;
};

/// Place renders scenes on one rig.
struct Place {
  optics::Rig of = make_rig({.width = 400, .height = 240, .pixel_mm = 0.2});
  optics::OpticalModel model{of};
  Stage stage = make_tiny_stage();

  struct Rendered {
    frames::WovenFrame frame;
    RenderStatistics statistics;
  };
  /// Embree limits the threads of the process to those that commit the scene.
  [[nodiscard]] Rendered render(Method& method, const SceneDescription& description,
                                int threads) const {
    const Scene scene(description, stage, {}, threads);
    Rendered out{frames::WovenFrame({of.panel.width_px, of.panel.height_px}), {}};
    out.statistics = method.render(scene, stage, out.frame);
    EXPECT_TRUE(out.statistics.completed);
    return out;
  }
  [[nodiscard]] Rendered render(const std::string& method, const SceneDescription& description,
                                const RenderOptions& options) const {
    return render(*make_method(method, model, options), description, options.threads);
  }
};

double share_beyond(const frames::WovenFrame& a, const frames::WovenFrame& b, double error) {
  size_t beyond = 0;
  for (size_t n = 0; n < a.bytes().size(); ++n)
    beyond += std::abs(int{a.bytes()[n]} - int{b.bytes()[n]}) > error ? 1 : 0;
  return static_cast<double>(beyond) / static_cast<double>(a.bytes().size());
}

/// Returns the number of audited subpixels that differ.
size_t audited_differently(const frames::WovenFrame& a, const frames::WovenFrame& b) {
  size_t different = 0;
  const auto width = static_cast<uint32_t>(3 * a.width());
  for (int row = 0; row < a.height(); ++row)
    for (uint32_t stretch = 0; stretch * kSampledOneIn < width; ++stretch) {
      const SampledPair sampled = AuditSelection{}.pair(static_cast<uint32_t>(row), stretch);
      for (const uint32_t at : {sampled.retracing, sampled.evaluation})
        different += at < width && a.row(row)[at] != b.row(row)[at] ? 1 : 0;
    }
  return different;
}

TEST(AdaptiveMaterials, KeepTheBoundAndSaveWork) {
  const Place place;
  uint64_t interpolated = 0, shaded = 0;
  for (int seed = 0; seed < kScenes; seed += 2) {
    const SceneDescription scene = Random(seed).scene();
    const frames::WovenFrame full = place.render("full", scene, {}).frame;
    for (const double error : {1.0, 2.0, 4.0}) {
      const Place::Rendered adaptive =
          place.render("adaptive", scene, {.tolerated_error = error, .cancelled = {}});
      const RenderStatistics& s = adaptive.statistics;
      const double beyond = share_beyond(full, adaptive.frame, error);
      // Where method full renders the frame there is no audit.
      EXPECT_LE(beyond, s.audited_subpixels > 0 ? s.beyond_bound : 0.0) << seed << ", " << error;
      EXPECT_EQ(audited_differently(full, adaptive.frame), 0U) << seed << ", " << error;
      EXPECT_EQ(s.interpolated_subpixels + s.traced_subpixels, s.subpixels);
      interpolated += s.interpolated_subpixels;
      shaded += s.traced_subpixels + s.retraced_subpixels;
    }
  }
  EXPECT_GT(interpolated, shaded);
}

TEST(AdaptiveMaterials, WithZeroErrorHaveTheBytesOfFull) {
  const Place place;
  for (int seed = 0; seed < kScenes; ++seed) {
    const SceneDescription scene = Random(seed).scene();
    EXPECT_EQ(place.render("full", scene, {}).frame,
              place.render("adaptive", scene, {.tolerated_error = 0.0, .cancelled = {}}).frame)
        << seed;
  }
}

TEST(AdaptiveMaterials, HaveTheSameBytesForAnyThreadsTilesAndInstructionSet) {
  const Place place;
  for (int seed = 0; seed < kScenes; seed += 3) {
    const SceneDescription scene = Random(seed).scene();
    const Place::Rendered one = place.render("adaptive", scene, {.threads = 1, .cancelled = {}});
    const auto same = [&](const RenderOptions& options) {
      const Place::Rendered other = place.render("adaptive", scene, options);
      EXPECT_EQ(one.frame, other.frame) << seed;
      EXPECT_EQ(one.statistics.beyond_bound, other.statistics.beyond_bound) << seed;
    };
    same({.threads = 3, .cancelled = {}});
    same({.threads = 8, .tiles_backwards = true, .cancelled = {}});
    for (const Isa isa : test::every_instruction_set())
      same({.threads = 1, .isa = isa, .cancelled = {}});
  }
}

TEST(AdaptiveMaterials, DoNotDependOnEarlierFrames) {
  const Place place;
  for (const bool copy : {false, true}) {
    const RenderOptions options{.threads = 2, .copy_unchanged = copy, .cancelled = {}};
    const auto sequence = make_method("adaptive", place.model, options);
    for (int seed = 0; seed < 4; ++seed) {
      SceneDescription scene = Random(seed).scene();
      for (int frame = 0; frame < 2; ++frame) {
        EXPECT_EQ(place.render(*sequence, scene, options.threads).frame,
                  place.render("adaptive", scene, options).frame)
            << seed << ", " << frame;
        if (!scene.spheres.empty()) scene.spheres.front().centre.x += 0.1;
      }
    }
  }
}

/// Returns a wall whose colours change by a few codes from texel to texel, which samples some
/// pixels apart miss, in the given part of its height from the top.
SceneDescription noisy_wall(double noisy_part) {
  SceneDescription scene;
  PbrMaterial paper;
  paper.unlit = true;
  paper.base_colour_texture.texture = 0;
  auto noise = std::make_shared<Texture>();
  noise->width = 512;
  noise->height = 1024;
  std::mt19937_64 engine(3);
  std::uniform_real_distribution<float> any(0.2F, 0.8F);
  for (int row = 0; row < noise->height; ++row)
    for (int n = 0; n < 4 * noise->width; ++n)
      noise->rgba.push_back(row < noisy_part * noise->height ? any(engine) : 0.5F);
  scene.textures = {noise};
  scene.materials.push_back({.name = "paper", .pbr = std::make_shared<PbrMaterial>(paper)});
  TriangleMesh sheet = test::rectangle_mesh({-5, -9, 0}, {10, 0, 0}, {0, 18, 0}, 0);
  sheet.uvs = {{0, 1}, {1, 1}, {1, 0}, {0, 0}};
  scene.meshes = {sheet};
  return scene;
}

TEST(AdaptiveMaterials, FullRendersThePartOfAFrameWhereItIsFaster) {
  const Place place{.of = make_rig({.width = 160, .height = 1600, .pixel_mm = 0.1})};
  const SceneDescription scene = noisy_wall(0.3);
  const Place::Rendered full = place.render("full", scene, {});
  const auto with = [&](int threads) {
    return place.render("adaptive", scene,
                        {.threads = threads, .tolerated_error = 1.0, .cancelled = {}});
  };
  const Place::Rendered adaptive = with(1);
  const RenderStatistics& s = adaptive.statistics;
  EXPECT_EQ(adaptive.frame, with(4).frame);
  EXPECT_LE(share_beyond(full.frame, adaptive.frame, 1.0), s.beyond_bound);
  // The plain part is interpolated. The noisy part, three tenths of the frame, is left to full.
  EXPECT_GT(s.interpolated_subpixels, s.subpixels / 2);
  EXPECT_GT(s.retraced_subpixels, s.subpixels / 5);
  EXPECT_LE(s.retraced_subpixels, s.subpixels * 3 / 10);
  EXPECT_GT(s.traced_subpixels, s.subpixels / 8);
  EXPECT_EQ(s.interpolated_subpixels + s.traced_subpixels, s.subpixels);
  EXPECT_EQ(audited_differently(full.frame, adaptive.frame), 0U);
}

}  // namespace
}  // namespace lenticule::render
