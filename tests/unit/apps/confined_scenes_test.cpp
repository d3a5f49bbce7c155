// SPDX-License-Identifier: Apache-2.0
// Tests models that are read by a process without rights, whose textures others decode.
#include "apps/lenticule-tools/offline/confined_scenes.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/wait.h>
#include <unistd.h>

#include <chrono>
#include <csignal>
#include <filesystem>
#include <fstream>
#include <string>
#include <vector>

#include "base/error.h"
#include "base/file.h"
#include "frames/image_io.h"
#include "frames/picture_codec.h"
#include "player/sources/confined_pictures.h"
#include "tests/support/archive_bytes.h"
#include "tests/support/error_matchers.h"
#include "tests/support/scratch_folder.h"

namespace lenticule::tools {
namespace {

namespace fs = std::filesystem;
using std::chrono::milliseconds;

constexpr const char* kTriangle =
    "v 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\nvt 1 0\nvt 0 1\nusemtl paint\nf 1/1 2/2 3/3\n";

/// Returns the processes that this one started from a program.
std::vector<pid_t> children_named(const std::string& program) {
  std::vector<pid_t> found;
  for (const fs::directory_entry& task : fs::directory_iterator("/proc/self/task")) {
    std::ifstream children(task.path() / "children");
    for (pid_t child = 0; children >> child;) {
      std::error_code gone;
      const fs::path exe = fs::read_symlink("/proc/" + std::to_string(child) + "/exe", gone);
      if (exe.filename() == fs::path(program).filename()) found.push_back(child);
    }
  }
  return found;
}

class ConfinedScenesTest : public testing::Test {
 protected:
  ConfinedScenesTest() { frames::use_picture_reader(&pictures_); }
  ~ConfinedScenesTest() override {
    frames::use_picture_reader(nullptr);
    render::use_scene_reader(nullptr);
  }

  fs::path write(const std::string& name, const std::string& text) const {
    fs::create_directories((folder_ / name).parent_path());
    write_text_file(folder_ / name, text);
    return folder_ / name;
  }
  fs::path data(const std::string& name) const {
    return fs::path(LENTICULE_SOURCE_DIR) / "tests/data" / name;
  }

  /// Expects the same scene or the same error from both processes.
  void expect_same(const fs::path& file) {
    SCOPED_TRACE(file);
    struct Outcome {
      std::vector<uint8_t> scene;
      std::string error, hint;
    };
    const auto load = [&](const render::SceneReader* reader) {
      render::use_scene_reader(reader);
      try {
        return Outcome{
            .scene = test::archive_of(render::load_scene(file)), .error = {}, .hint = {}};
      } catch (const Error& error) {
        EXPECT_EQ(error.kind(), ErrorKind::Input);
        return Outcome{.scene = {}, .error = error.what(), .hint = error.hint()};
      }
    };
    const Outcome here = load(nullptr), there = load(&scenes_);
    EXPECT_TRUE(here.scene == there.scene);
    EXPECT_EQ(here.error, there.error);
    EXPECT_EQ(here.hint, there.hint);
  }

  test::ScratchFolder folder_;
  player::ConfinedPictures pictures_{LENTICULE_PICTURES_PROGRAM};
  ConfinedScenes scenes_{LENTICULE_READER_PROGRAM};
};

TEST_F(ConfinedScenesTest, EveryFormatGivesTheSceneThatThisProcessWouldRead) {
  for (const char* name :
       {"pyramid.obj", "turning-box.gltf", "textured-quad.gltf", "missing-texture.gltf",
        "tetrahedron.ply", "tetrahedron.stl", "every-line.nff", "broken/truncated.gltf",
        "broken/empty.obj", "broken/nan-vertex.nff", "broken/truncated.glb", "crate.png",
        "no-such-file.obj"})
    expect_same(data(name));
}

TEST_F(ConfinedScenesTest, FilesThatAModelNamesAreFoundAsByThisProcess) {
  fs::create_directories(folder_ / "Textures");
  fs::copy_file(data("crate.png"), folder_ / "Textures/Crate.PNG");
  fs::copy_file(data("crate.png"), folder_ / "two words.png");
  frames::WovenFrame frame({.width = 3, .height = 2});
  frames::write_woven(frame.view(), folder_ / "rough.tif");
  write("Paint.MTL",
        "newmtl paint\nKd 1 1 1\nmap_Kd textures\\crate.png\nmap_Ke two%20words.png\n"
        "Pr 0.5\nmap_Pr rough.tif\nmap_Pm Textures/Crate.PNG\nnorm none.png\n");
  expect_same(write("model.obj", std::string("mtllib paint.mtl\n") + kTriangle));
  const render::SceneDescription scene = scenes_.load(folder_ / "model.obj", {});
  EXPECT_EQ(scene.textures.size(), 3U) << "colour, light, and roughness with metalness";
  EXPECT_THAT(scene.notes, testing::Contains(testing::HasSubstr("none.png")));
  // A model in a folder beside its textures.
  write("models/paint.mtl", "newmtl paint\nmap_Kd ../Textures/Crate.PNG\n");
  expect_same(write("models/model.obj", std::string("mtllib paint.mtl\n") + kTriangle));
}

TEST_F(ConfinedScenesTest, ALargeTextureIsReducedWithANote) {
  frames::write_woven(frames::WovenFrame({.width = 32768, .height = 2049}).view(),
                      folder_ / "large.png");
  write("paint.mtl", "newmtl paint\nmap_Kd large.png\n");
  // ImageRead.ALargeTextureIsReducedByMeansOfItsLight compares the texels, in this process.
  const render::SceneDescription scene =
      scenes_.load(write("model.obj", std::string("mtllib paint.mtl\n") + kTriangle), {});
  EXPECT_THAT(scene.notes, testing::Contains(testing::HasSubstr("reduced to 16384 x 1025 texels")));
  ASSERT_EQ(scene.textures.size(), 1U);
  EXPECT_EQ(scene.textures.front()->width, 16384);
  EXPECT_EQ(scene.textures.front()->height, 1025);
}

TEST_F(ConfinedScenesTest, ATextureWhoseDecoderEndsIsLeftOut) {
  const player::ConfinedPictures faulty(LENTICULE_FAKE_PICTURES);
  frames::use_picture_reader(&faulty);
  write("bad.tif", "crash");
  write("good.tif", "lies about the width");
  write("paint.mtl", "newmtl paint\nmap_Kd bad.tif\nmap_Ke good.tif\nPr 1\n");
  const render::SceneDescription scene =
      scenes_.load(write("model.obj", std::string("mtllib paint.mtl\n") + kTriangle), {});
  EXPECT_EQ(scene.meshes.size(), 1U);
  EXPECT_THAT(
      scene.notes,
      testing::IsSupersetOf({testing::HasSubstr("bad.tif: its decoder was ended by signal 6"),
                             testing::HasSubstr("good.tif: its decoder answered out of order")}));
}

// Some versions of assimp end or take all memory for these files, others refuse or read them.
TEST_F(ConfinedScenesTest, FilesThatEndedTheProgramAreErrorsOrScenes) {
  const std::string kRaw =
      "0.0 1.0 0.0 0 0 0 1 0 0 0 1 0\n0.0 1.0 0.0 0 0 1 1 0 1 0 1 1\nobj2\n"
      "1.0 0.0 0.0 0 0 2 1 0 2 0 1 2\n";
  const std::string kMany = "OFF\n1300000000 6 0\n0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n";
  for (const fs::path& file : {write("objects.raw", kRaw), write("many.off", kMany),
                               write("none.md2", "IDP2"), write("none.3mf", "PK\x03\x04"),
                               write("none.md5mesh", "MD5Version 10\nnumMeshes 9999999\n"),
                               write("none.ogex", "Metric (key = \"up\")\nGeometryNode {}\n"),
                               write("none.x", "xof 0303")}) {
    try {
      (void)scenes_.load(file, {});
    } catch (const Error& error) {
      test::expect_error(error, ErrorKind::Input, file.string());
    }
    expect_same(data("tetrahedron.stl"));
  }
}

TEST_F(ConfinedScenesTest, TheReaderHasNoRightsAndLimitedMemory) {
  (void)scenes_.load(data("tetrahedron.stl"), {});
  const std::vector<pid_t> readers = children_named(LENTICULE_READER_PROGRAM);
  ASSERT_EQ(readers.size(), 1U);
#ifndef LENTICULE_SANITIZED  // a reader with a sanitizer is not confined
  const fs::path process = "/proc/" + std::to_string(readers.front());
  const std::string status = test::read_text(process / "status");
  EXPECT_THAT(status, testing::HasSubstr("NoNewPrivs:\t1"));
  EXPECT_THAT(status, testing::HasSubstr("Seccomp:\t2"));
  EXPECT_THAT(test::read_text(process / "limits"),
              testing::Not(testing::ContainsRegex("Max address space +unlimited")));
#endif
}

TEST_F(ConfinedScenesTest, AReaderThatWasKilledIsReplaced) {
  for (int n = 0; n < 3; ++n) {
    expect_same(data("tetrahedron.stl"));
    for (const pid_t reader : children_named(LENTICULE_READER_PROGRAM)) {
      ASSERT_EQ(::kill(reader, SIGKILL), 0);
      // Without being reaped: only its owner waits for it.
      siginfo_t end{};
      ASSERT_EQ(::waitid(P_PID, id_t(reader), &end, WEXITED | WNOWAIT), 0);
    }
  }
}

class FaultyReaderTest : public ConfinedScenesTest {
 protected:
  Error error_of(const std::string& name) {
    const fs::path file = write(name, "text");
    const auto begin = std::chrono::steady_clock::now();
    const Error error = test::error_of([&] { (void)faulty_.load(file, {}); });
    EXPECT_LT(std::chrono::steady_clock::now() - begin, std::chrono::minutes(1)) << name;
    EXPECT_TRUE(faulty_.load(write("well.obj", "text"), {}).meshes.empty());
    return error;
  }

  ConfinedScenes faulty_{LENTICULE_FAKE_READER,
                         {.processor_time = milliseconds(500), .silence = milliseconds(1000)}};
};

TEST_F(FaultyReaderTest, AReaderThatEndsOrHangsIsAnErrorOfItsModel) {
  const std::vector<std::pair<std::string, std::string>> kFaults = {
      {"crash.obj", "crash.obj: its reader was ended by signal 6"},
      {"leave.obj", "leave.obj: its reader ended with exit code 0"},
      {"stop.obj", "stop.obj: its reader did not respond for 1 s"},
      {"no-socket.obj", "no-socket.obj: its reader did not respond for 1 s"},
      {"spin.obj", "spin.obj: not read after"},
      {"ask.obj", "ask.obj: not read after"}};
  for (const auto& [name, message] : kFaults)
    test::expect_error(error_of(name), ErrorKind::Input, message, "save it again");
}

TEST_F(FaultyReaderTest, AReaderThatLiesIsAnErrorOfItsModel) {
  for (const char* name : {"another-word.obj", "ready-again.obj", "done.obj", "third-half.obj",
                           "half-before.obj", "empty-piece.obj", "large-piece.obj", "short.obj"}) {
    SCOPED_TRACE(name);
    test::expect_error(error_of(name), ErrorKind::Input, "its reader answered out of order",
                       "save it again");
  }
  test::expect_error(error_of("noise.obj"), ErrorKind::Input, "noise.obj: its reader made a scene");
  test::expect_error(error_of("false-texels.obj"), ErrorKind::Input,
                     "its reader names a texture that was not read");
}

}  // namespace
}  // namespace lenticule::tools
