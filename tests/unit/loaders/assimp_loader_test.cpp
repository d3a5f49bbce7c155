// SPDX-License-Identifier: Apache-2.0
// Tests the import of glTF, PLY and STL, and that broken files are refused without a crash.
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/stat.h>
#include <unistd.h>

#include <filesystem>
#include <fstream>
#include <tuple>

#include "render/loaders/load_scene.h"
#include "render/scene/stage.h"
#include "tests/support/error_matchers.h"

namespace lenticule::render {
namespace {

using test::error_of;
using ::testing::Contains;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::SizeIs;

std::filesystem::path data(const std::string& name) {
  return std::filesystem::path(LENTICULE_SOURCE_DIR) / "tests/data" / name;
}

/// A file that is removed after the test.
class TemporaryFile {
 public:
  TemporaryFile(const std::string& name, const std::string& text)
      : path_(std::filesystem::path(::testing::TempDir()) /
              (std::to_string(::getpid()) + "-" + name)) {
    std::ofstream(path_, std::ios::binary) << text;
  }
  ~TemporaryFile() { std::filesystem::remove(path_); }
  TemporaryFile(const TemporaryFile&) = delete;
  TemporaryFile& operator=(const TemporaryFile&) = delete;
  [[nodiscard]] const std::filesystem::path& path() const { return path_; }

 private:
  std::filesystem::path path_;
};

const Material& material_named(const SceneDescription& scene, const std::string& name) {
  for (const Material& material : scene.materials)
    if (material.name == name) return material;
  ADD_FAILURE() << "no material " << name;
  return scene.materials.front();
}

void expect_near(Vec3 a, Vec3 b, double tolerance) {
  EXPECT_LT(length(a - b), tolerance) << a.x << ' ' << a.y << ' ' << a.z;
}

// ---- glTF

class TurningBox : public ::testing::Test {
 protected:
  const SceneDescription scene_ = load_scene(data("turning-box.gltf"));
};

TEST_F(TurningBox, LoadsWithoutAWarning) { EXPECT_THAT(scene_.notes, IsEmpty()); }

TEST_F(TurningBox, ReadsItsExternalAndItsEmbeddedTexture) {
  ASSERT_THAT(scene_.textures, SizeIs(2));
  const auto texture_of = [&](const char* name) {
    return scene_.textures.at(
        static_cast<size_t>(material_named(scene_, name).pbr->base_colour_texture.texture));
  };
  EXPECT_EQ(texture_of("crate")->width, 128);
  EXPECT_EQ(texture_of("tiles")->width, 32);
  EXPECT_EQ(texture_of("crate")->codes.size(), 128U * 128U * 4U);
}

TEST_F(TurningBox, MaterialsFollowMetalnessAndRoughness) {
  const PbrMaterial& gold = *material_named(scene_, "gold").pbr;
  EXPECT_EQ(gold.metallic, 1.0);
  EXPECT_NEAR(gold.roughness, 0.35, 1e-6);
  const PbrMaterial& red = *material_named(scene_, "red").pbr;
  EXPECT_EQ(red.metallic, 0.0);
  EXPECT_NEAR(red.roughness, 0.25, 1e-6);
  expect_near(red.base_colour, {0.75, 0.03, 0.02}, 1e-6);
  EXPECT_TRUE(scene_.colour_managed);
}

TEST(Gltf, AMissingTextureIsReportedAndThePlainColourKept) {
  const SceneDescription scene = load_scene(data("missing-texture.gltf"));
  EXPECT_THAT(scene.notes, Contains(HasSubstr("there-is-no-such.png")));
  const Material& material = material_named(scene, "lost");
  EXPECT_EQ(material.pbr->base_colour_texture.texture, -1);
  expect_near(material.pbr->base_colour, {0.2, 0.4, 0.8}, 1e-6);
}

TEST(Gltf, AStillSceneHasNoNodes) {
  const SceneDescription scene = load_scene(data("textured-quad.gltf"));
  EXPECT_THAT(scene.nodes, IsEmpty());
  EXPECT_EQ(scene.duration_seconds, 0.0);
  EXPECT_THAT(scene.textures, SizeIs(1));
  // The quad lies in the ground plane of its node, and the node turns it upright.
  for (const Vec3 p : scene.meshes.at(0).positions) EXPECT_NEAR(p.z, 0.0, 1e-6);
}

// ---- the other formats

TEST(Ply, ReadsAMesh) {
  const SceneDescription scene = load_scene(data("tetrahedron.ply"));
  ASSERT_THAT(scene.meshes, SizeIs(1));
  EXPECT_THAT(scene.meshes[0].triangles, SizeIs(4));
  EXPECT_THAT(scene.meshes[0].positions, SizeIs(4));
}

TEST(Stl, ReadsAMeshWithFlatFaces) {
  const SceneDescription scene = load_scene(data("tetrahedron.stl"));
  ASSERT_THAT(scene.meshes, SizeIs(1));
  EXPECT_THAT(scene.meshes[0].triangles, SizeIs(4));
  EXPECT_THAT(scene.meshes[0].normals, IsEmpty());
}

TEST(Loaders, ExtensionsMayBeInCapitals) {
  const TemporaryFile copy("SHOUT.NFF", "s 0 0 0 1\n");
  EXPECT_THAT(load_scene(copy.path()).spheres, SizeIs(1));
}

// ---- errors

Error refused(const std::filesystem::path& file) {
  return error_of([&] { (void)load_scene(file); });
}

TEST(BrokenScenes, AreRefusedInOneLineWithTheFile) {
  for (const char* name :
       {"broken/truncated.gltf", "broken/truncated.glb", "broken/empty-scene.gltf",
        "broken/empty.obj", "broken/nan-vertex.nff"}) {
    const Error error = refused(data(name));
    EXPECT_EQ(error.kind(), ErrorKind::Input) << name;
    EXPECT_THAT(error.what(), HasSubstr(name));
    EXPECT_THAT(error.what(), ::testing::Not(HasSubstr("\n")));
    EXPECT_LT(std::string(error.what()).size(), 400U);
  }
}

TEST(EmptyScenes, SayWhyThereIsNothingToSee) {
  const auto refusal = [](const std::string& name, const std::string& text) {
    const TemporaryFile file(name, text);
    return std::string(error_of([&] { (void)load_scene(file.path()); }).what());
  };
  EXPECT_THAT(refusal("cloud.ply",
                      "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\n"
                      "property float y\nproperty float z\nend_header\n0 0 0\n1 0 0\n0 1 0\n"),
              HasSubstr("nothing to see in this scene: 3 points without faces left out"));
  EXPECT_THAT(refusal("flat.obj", "v 0 0 0\nv 1 0 0\nv 2 0 0\nv 3 0 0\nf 1 2 3\nf 2 3 4\n"),
              HasSubstr("nothing to see in this scene: 2 triangles without an area dropped"));
}

TEST(BrokenScenes, EveryTruncationIsRefusedOrSurvived) {
  std::ifstream in(data("textured-quad.gltf"), std::ios::binary);
  const std::string whole{std::istreambuf_iterator<char>(in), {}};
  for (size_t size = 0; size < whole.size(); size += 61) {
    const TemporaryFile part("part.gltf", whole.substr(0, size));
    try {
      EXPECT_FALSE(load_scene(part.path()).meshes.empty());
    } catch (const Error& error) {
      EXPECT_EQ(error.kind(), ErrorKind::Input);
    }
  }
}

TEST(BrokenScenes, MissingUnknownAndSpecialFilesAreRefused) {
  EXPECT_THAT(refused("/no/such.gltf").what(), HasSubstr("no such file"));
  const TemporaryFile text("scene.unheard-of", "x");
  EXPECT_THAT(refused(text.path()).what(), HasSubstr(".unheard-of"));
  EXPECT_THAT(refused(::testing::TempDir()).what(), HasSubstr("not a regular file"));
  EXPECT_THAT(refused("/dev/null").what(), HasSubstr("not a regular file"));
}

TEST(BrokenScenes, OtherThingsThanModelsAreNamed) {
  const std::tuple<const char*, const char*, const char*> files[] = {
      {"a.glb", "\x89LTS\r\n", "a film of lenticule"},
      {"a.glb", "version https://git-lfs.github.com/spec/v1\noid sha256:0\nsize 1\n", "Git LFS"},
      {"a.obj", "version https://git-lfs.github.com/spec/v1\noid sha256:0\nsize 1\n", "Git LFS"},
      {"a.stl", "<!DOCTYPE html>\n<html><body>404</body></html>\n", "page of the web"},
      {"a.glb", "", "empty"},
      {"a.glb", "\x89PNG\r\n\x1a\n", "a picture"},
      {"a.obj", "\xFF\xD8\xFF\xE0", "a picture"},
      {"a.glb", "....ftypisom", "a film"},
      {"a.stl", "\x1A\x45\xDF\xA3....", "a film"},
      {"a.ply", "RIFF....WEBP", "a picture or a film"},
      {"a.usda", "#usda 1.0\n", "USD"},
      {"a.usdz", "PK\3\4", "USD"},
      {"a.blend", "BLENDER-v300", "Blender"},
      {"a.splat", "....", "Gaussian splats"},
      {"a.gltf", R"({"asset":{"version":"1.0"}})", "gltf-pipeline"},
      {"a.ply", "ply\nformat ascii 1.0\nelement vertex 1\nproperty float f_dc_0\nend_header\n0\n",
       "Gaussian splats"}};
  for (const auto& [name, bytes, word] : files) {
    const TemporaryFile file(name, bytes);
    const Error error = refused(file.path());
    EXPECT_THAT(error.what(), HasSubstr(word)) << name;
    EXPECT_THAT(error.what(), HasSubstr(name));
  }
}

TEST(BrokenScenes, APipeIsRefusedWithoutWaiting) {
  const auto pipe =
      std::filesystem::path(::testing::TempDir()) / (std::to_string(::getpid()) + "-pipe.obj");
  ASSERT_EQ(::mkfifo(pipe.c_str(), 0600), 0);
  EXPECT_THAT(refused(pipe).what(), HasSubstr("not a regular file"));
  std::filesystem::remove(pipe);
}

}  // namespace
}  // namespace lenticule::render
