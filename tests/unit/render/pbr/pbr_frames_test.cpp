// SPDX-License-Identifier: Apache-2.0
// Frames of small metallic-roughness scenes by method full.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <set>

#include "base/error.h"
#include "frames/srgb.h"
#include "render/methods/method.h"
#include "render/scene/surroundings.h"
#include "render/scene/texture.h"
#include "render/shading/pbr_scene.h"
#include "tests/support/tiny_scenes.h"

namespace lenticule::render {
namespace {

using test::make_rig;
using test::make_tiny_stage;
using test::rectangle_mesh;

constexpr Vec3 kWhite{1, 1, 1};

/// One unit is nine millimetres; the panel is 48 mm wide, so a quad of this size fills it.
constexpr double kHalf = 20.0;

optics::Rig small_rig() { return make_rig({.width = 32, .height = 20, .pixel_mm = 1.5}); }

frames::WovenFrame rendered(const SceneDescription& description,
                            const Surroundings& surroundings = {},
                            const std::string& method = "full", const RenderOptions& options = {}) {
  const optics::Rig rig = small_rig();
  const optics::OpticalModel model(rig);
  const Stage stage = make_tiny_stage();
  const Scene scene(description, stage, surroundings, options.threads);
  frames::WovenFrame frame({rig.panel.width_px, rig.panel.height_px});
  EXPECT_TRUE(make_method(method, model, options)->render(scene, stage, frame).completed);
  return frame;
}

/// Returns the smallest and the largest code of a channel.
std::pair<int, int> codes_of(const frames::WovenFrame& frame, size_t channel) {
  int low = 255, high = 0;
  for (size_t n = channel; n < frame.bytes().size(); n += 3) {
    low = std::min<int>(low, frame.bytes()[n]);
    high = std::max<int>(high, frame.bytes()[n]);
  }
  return {low, high};
}

/// Expects every subpixel to show a colour, within `codes`.
void expect_colour(const frames::WovenFrame& frame, Vec3 light, int codes = 0) {
  for (size_t c = 0; c < 3; ++c) {
    const double value = c == 0 ? light.x : c == 1 ? light.y : light.z;
    const int wanted = frames::code_from_linear(value);
    const auto [low, high] = codes_of(frame, c);
    EXPECT_GE(low, wanted - codes) << "channel " << c;
    EXPECT_LE(high, wanted + codes) << "channel " << c;
  }
}

/// Adds a quad at a depth, in units before the panel, that faces the viewer; returns its material.
PbrMaterial& add_quad(SceneDescription& scene, double z, PbrMaterial material = {},
                      bool faces_away = false) {
  const Vec3 corner{-kHalf, -kHalf, z}, x{2 * kHalf, 0, 0}, y{0, 2 * kHalf, 0};
  TriangleMesh mesh = rectangle_mesh(corner, faces_away ? y : x, faces_away ? x : y,
                                     static_cast<int>(scene.materials.size()));
  mesh.uvs.clear();
  for (const Vec3& p : mesh.positions)
    mesh.uvs.push_back({static_cast<float>((p.x + kHalf) / (2 * kHalf)),
                        static_cast<float>((kHalf - p.y) / (2 * kHalf))});
  scene.meshes.push_back(mesh);
  const auto shared = std::make_shared<PbrMaterial>(material);
  scene.materials.push_back({.name = "quad", .pbr = shared});
  return *shared;
}

PbrMaterial unlit(Vec3 colour, double alpha = 1.0) {
  PbrMaterial material;
  material.base_colour = colour;
  material.alpha = alpha;
  material.unlit = true;
  if (alpha < 1.0) material.alpha_mode = PbrMaterial::AlphaMode::Blend;
  return material;
}

/// A surface without mirrored light.
PbrMaterial matt(Vec3 colour) {
  PbrMaterial material;
  material.base_colour = colour;
  material.metallic = 0.0;
  material.specular = 0.0;
  return material;
}

Light sun(Vec3 direction, double light) {
  Light sun;
  sun.kind = Light::Kind::Directional;
  sun.direction = normalized(direction);
  sun.colour = kWhite * light;
  return sun;
}

/// A scene lit by nothing.
SceneDescription dark_scene() {
  SceneDescription scene;
  scene.source = "test";
  scene.ambient = Vec3{};
  return scene;
}

int add_texture(SceneDescription& scene, int width, int height,
                const std::function<std::array<float, 4>(int, int)>& texel) {
  auto texture = std::make_shared<Texture>();
  texture->width = width;
  texture->height = height;
  for (int y = 0; y < height; ++y)
    for (int x = 0; x < width; ++x)
      for (const float v : texel(x, y)) texture->rgba.push_back(v);
  scene.textures.push_back(texture);
  return static_cast<int>(scene.textures.size()) - 1;
}

TEST(PbrFrames, UnlitSurfacesShowTheirColourUnderEveryToneMap) {
  SceneDescription scene;
  const Vec3 colour{0.2, 0.55, 0.7};
  add_quad(scene, 0.0, unlit(colour));
  expect_colour(rendered(scene), colour);
  for (const ToneMap map : {ToneMap::None, ToneMap::PbrNeutral, ToneMap::Aces})
    expect_colour(rendered(scene, {.tone_map = map}), colour, 1);
}

TEST(PbrFrames, TheStudioHasALightGreyBackground) {
  SceneDescription scene;
  add_quad(scene, 0.0, unlit({0, 0, 0}), true);  // seen from behind
  expect_colour(rendered(scene), kStudioBackground);
  expect_colour(rendered(scene, {.background = Vec3{0.1, 0.2, 0.3}}), {0.1, 0.2, 0.3});
}

TEST(PbrFrames, TheStudiosBackgroundIsDarkBehindBrightModels) {
  const auto behind = [](Vec3 colour) {
    SceneDescription scene;
    add_quad(scene, 0.0, unlit(colour), true);  // not seen
    return scene;
  };
  const SceneDescription white = behind({0.8, 0.8, 0.8});
  expect_colour(rendered(white), kDarkStudioBackground);
  expect_colour(rendered(white, {.background = Vec3{1, 1, 1}}), {1, 1, 1});
  expect_colour(rendered(behind({0.3, 0.3, 0.3})), kStudioBackground);
  expect_colour(rendered(behind({0.1, 0.1, 0.1})), kStudioBackground);
  SceneDescription stated = white;
  stated.background = {0.5, 0.4, 0.3};
  expect_colour(rendered(stated), stated.background);
}

TEST(PbrFrames, TheStudiosBackgroundFollowsWhatTexturesAndVertexColoursShow) {
  SceneDescription scene;
  PbrMaterial& quad = add_quad(scene, 0.0, unlit({1, 1, 1}));
  EXPECT_EQ(studio_background(scene), kDarkStudioBackground);
  // Only a corner of the picture is used, as in an atlas.
  quad.base_colour_texture.texture = add_texture(scene, 8, 8, [](int x, int y) {
    const float v = x < 4 && y < 4 ? 0.9F : 0.0F;
    return std::array{v, v, v, 1.0F};
  });
  for (auto& uv : scene.meshes[0].uvs) uv = {0.3F * uv[0], 0.3F * uv[1]};
  EXPECT_EQ(studio_background(scene), kDarkStudioBackground);
  scene.meshes[0].colours.assign(4, {0.2F, 0.2F, 0.2F, 1.0F});
  EXPECT_EQ(studio_background(scene), kStudioBackground);
  scene.lights.push_back(sun({0, -1, -1}, 0.9));
  EXPECT_EQ(studio_background(scene), std::nullopt);
}

TEST(PbrFrames, BackFacesAreSeenOfDoubleSidedMaterialsAlone) {
  SceneDescription scene;
  PbrMaterial& front = add_quad(scene, 0.5, unlit({0.9, 0.1, 0.1}), true);
  add_quad(scene, 0.0, unlit({0.1, 0.5, 0.2}));
  expect_colour(rendered(scene), {0.1, 0.5, 0.2});
  front.double_sided = true;
  expect_colour(rendered(scene), {0.9, 0.1, 0.1});
}

/// Layers cover each other by depth, in whatever order the file has them.
TEST(PbrFrames, BlendedSurfacesCoverEachOtherFromBackToFront) {
  const Vec3 layers[] = {{0.9, 0.1, 0.2}, {0.1, 0.8, 0.3}, {0.2, 0.3, 0.9}};
  const double alphas[] = {0.5, 0.25, 0.6};
  Vec3 wanted{0.4, 0.4, 0.4};
  for (int n = 0; n < 3; ++n) wanted = layers[n] * alphas[n] + wanted * (1.0 - alphas[n]);
  for (const auto& order : {std::array{0, 1, 2}, std::array{2, 0, 1}, std::array{1, 2, 0}}) {
    SceneDescription scene = dark_scene();
    scene.background = {0.4, 0.4, 0.4};
    for (const int n : order) add_quad(scene, 0.3 * n, unlit(layers[n], alphas[n]));
    expect_colour(rendered(scene), wanted);
  }
}

TEST(PbrFrames, AnInvisibleSurfaceChangesNothing) {
  SceneDescription scene;
  add_quad(scene, 0.0, unlit({1, 0, 0}, 0.0));
  expect_colour(rendered(scene), kStudioBackground);
  add_quad(scene, -1.0, unlit({0.3, 0.2, 0.1}));
  expect_colour(rendered(scene), {0.3, 0.2, 0.1});
}

TEST(PbrFrames, MasksCutAtTheirCutoff) {
  SceneDescription scene;
  PbrMaterial& mask = add_quad(scene, 0.5, unlit({0.9, 0.1, 0.1}));
  add_quad(scene, 0.0, unlit({0.1, 0.5, 0.2}));
  mask.alpha_mode = PbrMaterial::AlphaMode::Mask;
  mask.alpha_cutoff = 0.4;
  mask.alpha = 0.39;
  expect_colour(rendered(scene), {0.1, 0.5, 0.2});
  mask.alpha = 0.41;
  expect_colour(rendered(scene), {0.9, 0.1, 0.1});
}

TEST(PbrFrames, MattSurfacesShowLambertsLawAndAmbientLight) {
  SceneDescription scene = dark_scene();
  scene.ambient = Vec3{0.1, 0.1, 0.1};
  const Vec3 colour{0.8, 0.4, 0.2};
  add_quad(scene, 0.0, matt(colour));
  scene.lights.push_back(sun({0, -1, -1}, 0.9));
  expect_colour(rendered(scene), colour * (0.9 * std::sqrt(0.5) + 0.1));
  scene.lights.front().direction = {0, 0, 1};  // from behind
  expect_colour(rendered(scene), colour * 0.1);
}

TEST(PbrFrames, ColoursAreMultipliedByTextureAndVertexColours) {
  SceneDescription scene;
  PbrMaterial& quad = add_quad(scene, 0.0, unlit({0.9, 0.9, 0.9}));
  quad.base_colour_texture.texture = add_texture(scene, 1, 1, [](int, int) {
    return std::array{0.5F, 0.25F, 1.0F, 1.0F};
  });
  scene.meshes.front().colours.assign(4, {1.0F, 0.5F, 0.5F, 1.0F});
  expect_colour(rendered(scene), {0.9 * 0.5, 0.9 * 0.125, 0.9 * 0.5});
}

/// Lets the light of a sun through a quad whose left half is missing, onto a wall.
SceneDescription shadow_scene(const PbrMaterial& caster, bool has_hole) {
  SceneDescription scene = dark_scene();
  scene.ambient = Vec3{0.1, 0.1, 0.1};
  add_quad(scene, -1.0, matt(kWhite));
  PbrMaterial& before = add_quad(scene, 15.0, caster);
  // To the right of the view; its shadow falls to the left, with the edge of the hole in the middle
  // of the view.
  for (Vec3& p : scene.meshes.back().positions) p.x += 16.0;
  before.double_sided = true;
  if (has_hole)
    before.base_colour_texture.texture = add_texture(scene, 2, 1, [](int x, int) {
      return std::array{1.0F, 1.0F, 1.0F, x == 0 ? 0.0F : 1.0F};
    });
  scene.lights.push_back(sun({-1, 0, -1}, 1.0));
  return scene;
}

std::set<int> shades_of(const SceneDescription& scene) {
  // The caster lies in front of the nearest content that is shown.
  const optics::Rig rig = small_rig();
  const optics::OpticalModel model(rig);
  Stage stage = make_tiny_stage();
  stage.near_mm = 5.0;
  const Scene committed(scene, stage, {});
  frames::WovenFrame frame({rig.panel.width_px, rig.panel.height_px});
  (void)make_method("full", model, {})->render(committed, stage, frame);
  return {frame.bytes().begin(), frame.bytes().end()};
}

TEST(PbrFrames, MasksCastShadowsWithHoles) {
  const int lit = frames::code_from_linear(std::sqrt(0.5) + 0.1);
  const int shadow = frames::code_from_linear(0.1);
  PbrMaterial caster = matt(kWhite);
  EXPECT_EQ(shades_of(shadow_scene(caster, true)), std::set<int>({shadow}));
  caster.alpha_mode = PbrMaterial::AlphaMode::Mask;
  EXPECT_EQ(shades_of(shadow_scene(caster, true)), std::set<int>({shadow, lit}));
  EXPECT_EQ(shades_of(shadow_scene(caster, false)), std::set<int>({shadow}));
}

TEST(PbrFrames, BlendedSurfacesCastAPartOfAShadow) {
  PbrMaterial caster = matt(kWhite);
  caster.alpha_mode = PbrMaterial::AlphaMode::Blend;
  caster.alpha = 0.25;
  EXPECT_EQ(shades_of(shadow_scene(caster, false)),
            std::set<int>({frames::code_from_linear(0.75 * std::sqrt(0.5) + 0.1)}));
}

TEST(PbrFrames, NormalMapsTurnTheLight) {
  // The normal of the map, which leans to the right and up.
  const Vec3 normal = normalized(Vec3{0.3, 0.4, 0.8});
  const Vec3 light = normalized(Vec3{-0.2, -0.5, -1.0});
  SceneDescription scene = dark_scene();
  PbrMaterial& quad = add_quad(scene, 0.0, matt({0.9, 0.9, 0.9}));
  quad.normal_texture.texture = add_texture(scene, 1, 1, [&](int, int) {
    const auto coded = [](double v) { return static_cast<float>(0.5 + 0.5 * v); };
    return std::array{coded(normal.x), coded(normal.y), coded(normal.z), 1.0F};
  });
  scene.lights.push_back(sun(light, 1.0));
  const Vec3 wanted = Vec3{0.9, 0.9, 0.9} * -dot(normal, light);
  expect_colour(rendered(scene), wanted);
  // Tangents that the file gives are those of the texture coordinates.
  scene.meshes.front().tangents.assign(4, {1.0F, 0.0F, 0.0F, 1.0F});
  expect_colour(rendered(scene), wanted);
  // Mirrored coordinates turn the map.
  scene.meshes.front().tangents.clear();
  for (auto& uv : scene.meshes.front().uvs) uv[0] = 1.0F - uv[0];
  expect_colour(rendered(scene),
                Vec3{0.9, 0.9, 0.9} * -dot(Vec3{-normal.x, normal.y, normal.z}, light));
  quad.normal_scale = 0.0;
  expect_colour(rendered(scene), Vec3{0.9, 0.9, 0.9} * -light.z);
}

TEST(PbrFrames, VolumesAbsorbLightAlongItsWay) {
  SceneDescription scene = dark_scene();
  add_quad(scene, -3.0, unlit({0.9, 0.9, 0.9}));
  PbrMaterial glass = matt(kWhite);
  glass.transmission = 1.0;
  glass.thickness = 1.0;
  glass.ior = 1.0;
  glass.attenuation_distance = 2.0;
  glass.attenuation_colour = {0.5, 0.25, 1.0};
  scene.meshes.push_back(test::box_mesh({-kHalf, -kHalf, -2.0}, {kHalf, kHalf, 0.0}, 1));
  scene.materials.push_back({.name = "glass", .pbr = std::make_shared<PbrMaterial>(glass)});
  // Oblique rays have a longer way.
  const frames::WovenFrame frame = rendered(scene);
  EXPECT_LE(codes_of(frame, 0).second, frames::code_from_linear(0.45));
  EXPECT_GE(codes_of(frame, 0).first, frames::code_from_linear(0.45 * 0.96));
  EXPECT_LE(codes_of(frame, 1).second, frames::code_from_linear(0.225));
  EXPECT_GE(codes_of(frame, 1).first, frames::code_from_linear(0.225 * 0.92));
  const auto [low, high] = codes_of(frame, 2);
  EXPECT_EQ(low, frames::code_from_linear(0.9));
  EXPECT_EQ(high, low);
}

TEST(PbrFrames, ThinTransmissionTintsWhatIsBehind) {
  SceneDescription scene = dark_scene();
  PbrMaterial film = matt({0.5, 0.8, 1.0});
  film.transmission = 1.0;
  add_quad(scene, 0.0, film);
  add_quad(scene, -1.0, unlit({0.6, 0.6, 0.6}));
  expect_colour(rendered(scene), {0.3, 0.48, 0.6});
}

/// Stripes far finer than the footprint of a subpixel show their mean in every view, near the panel
/// and far behind it.
TEST(PbrFrames, FineTexturesDoNotAlias) {
  for (const double z : {0.0, -12.0}) {
    SceneDescription scene;
    PbrMaterial& quad = add_quad(scene, z, unlit(kWhite));
    quad.base_colour_texture.texture = add_texture(scene, 512, 512, [](int x, int) {
      const float v = x % 2 == 0 ? 0.0F : 1.0F;
      return std::array{v, v, v, 1.0F};
    });
    quad.base_colour_texture.uv_map = {4, 0, 0, 0, 4, 0};
    expect_colour(rendered(scene), {0.5, 0.5, 0.5}, 3);
  }
}

TEST(PbrFrames, EightBitTexturesShowTheSameBytesAsFloats) {
  const auto scene_of = [](bool is_pbr, bool codes) {
    SceneDescription scene = dark_scene();
    PbrMaterial& quad = add_quad(scene, 0.0, unlit(kWhite));
    const int number = add_texture(scene, 31, 17, [](int x, int y) {
      const auto light = [](int code) {
        return static_cast<float>(frames::linear_of_codes()[static_cast<size_t>(code % 256)]);
      };
      return std::array{light(7 * x), light(13 * y), light(x * y), 1.0F};
    });
    quad.base_colour_texture.texture = number;
    if (!is_pbr) {
      scene.ambient = kWhite;
      scene.materials.front() = {.name = "plain", .texture = number};
    }
    auto texture = std::make_shared<Texture>(*scene.textures.front());
    if (codes) {
      EXPECT_TRUE(keep_codes(*texture, true));
    }
    scene.textures.front() = texture;
    return scene;
  };
  EXPECT_EQ(rendered(scene_of(false, false)), rendered(scene_of(false, true)));
  EXPECT_EQ(rendered(scene_of(true, false)).bytes().size(),
            rendered(scene_of(true, true)).bytes().size());
}

/// A scene with everything: layers, holes, glass, lights, a sphere.
SceneDescription rich_scene() {
  SceneDescription scene;
  scene.source = "test";
  PbrMaterial wall = matt({0.8, 0.7, 0.6});
  wall.specular = 1.0;
  wall.roughness = 0.6;
  add_quad(scene, -3.0, wall);
  PbrMaterial glass = matt({0.9, 1.0, 0.9});
  glass.specular = 1.0;
  glass.roughness = 0.05;
  glass.transmission = 1.0;
  glass.thickness = 1.0;
  PbrMaterial metal;
  metal.base_colour = {1.0, 0.8, 0.3};
  metal.roughness = 0.3;
  PbrMaterial veil = matt({0.2, 0.4, 0.9});
  veil.alpha_mode = PbrMaterial::AlphaMode::Blend;
  veil.alpha = 0.4;
  for (const PbrMaterial& m : {glass, metal, veil})
    scene.materials.push_back({.name = "m", .pbr = std::make_shared<PbrMaterial>(m)});
  scene.meshes.push_back(test::ball_mesh({-1.1, 0.1, 0.2}, 0.9, 12, 1));
  scene.spheres.push_back({.centre = {1.2, -0.2, 0.0}, .radius = 0.8, .material = 2});
  scene.meshes.push_back(rectangle_mesh({-2, -1, 1.2}, {3, 0, 0}, {0, 1, 0.2}, 3));
  return scene;
}

TEST(PbrFrames, AreTheSameWithAnyNumberOfThreadsAndEveryInstructionSet) {
  SceneDescription scene = rich_scene();
  for (const bool has_lights : {false, true}) {
    if (has_lights) scene.lights.push_back(sun({-0.4, -0.6, -1.0}, 0.8));
    const frames::WovenFrame one = rendered(scene, {}, "full", {.threads = 1, .cancelled = {}});
    EXPECT_GT(std::set<int>(one.bytes().begin(), one.bytes().end()).size(), 30U);
    EXPECT_EQ(one, rendered(scene, {}, "full", {.threads = 3, .cancelled = {}}));
    for (const Isa isa : {Isa::Baseline, Isa::Avx2})
      EXPECT_EQ(one, rendered(scene, {}, "full", {.threads = 1, .isa = isa, .cancelled = {}}));
  }
}

TEST(PbrFrames, CullingTheBackgroundChangesNothing) {
  const SceneDescription scene = rich_scene();
  for (const Surroundings& around : {Surroundings{}, Surroundings{.sky = true}})
    EXPECT_EQ(rendered(scene, around),
              rendered(scene, around, "full", {.skip_background = false, .cancelled = {}}));
}

TEST(PbrFrames, OfMethodAdaptiveWithoutErrorAreThoseOfMethodFull) {
  const SceneDescription scene = rich_scene();
  EXPECT_EQ(rendered(scene),
            rendered(scene, {}, "adaptive", {.tolerated_error = 0.0, .cancelled = {}}));
}

TEST(PbrFrames, AreRenderedByEveryMethod) {
  const SceneDescription scene = rich_scene();
  for (const std::string& method : method_names()) (void)rendered(scene, {}, method);
}

TEST(PbrFrames, OtherMaterialsOfTheSceneAreConverted) {
  SceneDescription scene = dark_scene();
  add_quad(scene, -1.0, unlit({0.3, 0.3, 0.3}));
  scene.materials.push_back({.name = "plain", .colour = {0.5, 0.6, 0.7}});
  add_quad(scene, 0.0);
  scene.meshes.back().material = 1;
  scene.lights.push_back(sun({0, 0, -1}, 0.8));
  expect_colour(rendered(scene), {0.4, 0.48, 0.56});
}

TEST(PbrFrames, AToneMapNeedsMetallicRoughnessMaterials) {
  SceneDescription scene = dark_scene();
  scene.materials.push_back({.name = "plain"});
  scene.meshes.push_back(rectangle_mesh({-1, -1, 0}, {2, 0, 0}, {0, 2, 0}, 0));
  const Stage stage = make_tiny_stage();
  EXPECT_THROW(Scene(scene, stage, {.tone_map = ToneMap::Aces}), Error);
}

TEST(PbrFrames, WrongMaterialsAreRefused) {
  const Stage stage = make_tiny_stage();
  const auto is_refused = [&](const std::function<void(PbrMaterial&, TriangleMesh&)>& spoil) {
    SceneDescription scene;
    scene.source = "test";
    PbrMaterial& material = add_quad(scene, 0.0);
    spoil(material, scene.meshes.front());
    EXPECT_THROW(Scene(scene, stage, {}), Error);
  };
  is_refused([](PbrMaterial& m, TriangleMesh&) { m.normal_texture.texture = 3; });
  is_refused([](PbrMaterial& m, TriangleMesh&) { m.roughness = std::nan(""); });
  is_refused([](PbrMaterial& m, TriangleMesh&) { m.ior = -1.0; });
  is_refused([](PbrMaterial& m, TriangleMesh&) { m.attenuation_distance = 0.0; });
  is_refused([](PbrMaterial&, TriangleMesh& mesh) { mesh.colours.resize(3); });
  is_refused([](PbrMaterial&, TriangleMesh& mesh) { mesh.tangents.resize(5); });
  is_refused([](PbrMaterial&, TriangleMesh& mesh) { mesh.uvs2.resize(1); });
}

}  // namespace
}  // namespace lenticule::render
