// SPDX-License-Identifier: Apache-2.0
// Frames that commands render, weave and play have the bytes that are committed in hashes/, on
// every system, with every compiler and instruction set (docs/measurements/same-bytes.md).
//
// Embree's kernels differ in the last bits from one instruction set to another (they may contract
// a*b+c), so those for SSE2 are selected here.
#include "base/cpu.h"
#include "frames/image_io.h"
#include "frames/sequence/sequence_reader.h"
#include "tests/commands/program.h"
#include "tests/golden/frames/golden_hashes.h"
#include "tests/support/instruction_sets.h"
#include "tests/support/noise_frame.h"

namespace lenticule::test {
namespace {

using Words = std::vector<std::string>;

class FramesStayEqual : public CommandTest {
 protected:
  /// Returns a copy of a rig whose panel has a small part of the pixels, which takes less time.
  [[nodiscard]] std::string rig(const std::string& name) const {
    constexpr int kSmall = 300, kLarge = 600;
    std::string text = read_text(source_file("scenes/rigs/" + name + ".toml"));
    for (const std::string key : {"width_px = ", "height_px = "}) {
      const size_t at = text.find(key) + key.size();
      const int size = std::stoi(text.substr(at));
      const int part = size < kSmall ? 1 : (size < kLarge ? 2 : 4);
      text.replace(at, std::to_string(size).size(), std::to_string(size / part));
    }
    write(name + ".toml", text);
    return path(name + ".toml");
  }

  void run_well(Words arguments) {
    Words words = program(std::move(arguments));
    words.insert(words.begin(), {"/usr/bin/env", "-C", path(""), "LENTICULE_EMBREE_ISA=sse2",
                                 "LENTICULE_ISA=" + isa_});
    const ProcessResult done = run_process(words);
    ASSERT_EQ(done.exit_code, 0) << fmt::format("{}", fmt::join(words, " ")) << ": " << done.err;
  }

  /// Renders `count` frames from `first` on, and records the hashes of their PPM files. A film is
  /// read here, since each process that writes a picture loads OpenImageIO, which takes longer than
  /// the frames.
  void render(const std::string& name, const std::string& scene, Words more, int first = 0,
              int count = 2) {
    Words arguments = {"render",
                       scene,
                       "--overwrite",
                       "-o",
                       path("film.lts"),
                       "--frames",
                       fmt::format("{}:{}", first, first + count)};
    arguments.insert(arguments.end(), more.begin(), more.end());
    run_well(arguments);
    const std::string panel = more.at(0) == "--wall" ? "-" + more.at(3) : "";
    note_film(name, "film" + panel + ".lts", first, count);
  }

  /// Records the hashes of the PPM files of a film's frames, whose names end with their numbers.
  void note_film(const std::string& name, const std::string& file, int first, int count) {
    const frames::SequenceReader film(path(file));
    ASSERT_EQ(film.frame_count(), static_cast<uint64_t>(count));
    frames::FrameDecoder decoder = film.make_decoder();
    frames::WovenFrame frame(film.info().geometry);
    for (int n = 0; n < count; ++n) {
      ASSERT_TRUE(decoder.decode(static_cast<uint64_t>(n), frame.bytes()));
      std::string ppm = fmt::format("P6\n{} {}\n255\n", frame.width(), frame.height());
      ppm.append(frame.bytes().begin(), frame.bytes().end());
      note_hash(fmt::format("{} {}", name, first + n), hash_of_text(ppm));
    }
  }

  /// Records the hash of a file. All files that a test records under one name must be equal.
  void note(const std::string& name, const std::string& file) {
    note_hash(name, hash_of_file(path(file)));
  }
  void note_hash(const std::string& name, const std::string& hash) {
    const auto [at, is_new] = hashes_.emplace(name, hash);
    if (!is_new) {
      EXPECT_EQ(at->second, hash) << name << " " << isa_;
    }
  }

  std::string isa_;  ///< instruction set of our kernels; empty: the machine's best
  Hashes hashes_;
};

/// The frames of these scenes differ from each other.
TEST_F(FramesStayEqual, OfEveryMethod) {
  for (const char* method : {"full", "adaptive", "lens-view", "interpolate", "temporal", "hybrid"})
    for (const std::string scene : {"tree:1", "gears:1", "room", "demo"}) {
      // The methods that reuse points have no more kinds of surfaces in the demo.
      if (scene == "demo" && method != std::string("full") && method != std::string("adaptive"))
        continue;
      render(fmt::format("{} {}", scene, method), fmt::format("builtin:{}", scene),
             {"--rig", rig("paper-64"), "--method", method}, 40);
    }
  expect_committed("methods", hashes_);
}

TEST_F(FramesStayEqual, OfEveryFeatureOfGltf) {
  const std::string models = path("models");
  ASSERT_EQ(run_process({JUDGE_MODELS, models}).exit_code, 0);
  for (const auto& model : std::filesystem::directory_iterator(models)) {
    const std::string name = model.path().stem().string();
    // Both methods shade alike. AdaptiveMaterials checks the samples that `adaptive` leaves out.
    const bool both = name == "base-texture" || name == "blend" || name == "iridescence";
    for (const char* method : both ? std::vector{"full", "adaptive"} : std::vector{"full"})
      render(name + " " + method, model.path().string(),
             {"--rig", rig("paper-64"), "--method", method}, 0, 1);
  }
  expect_committed("gltf", hashes_);
}

TEST_F(FramesStayEqual, OfAnObjWithATexture) {
  frames::write_woven(noise_frame(16, 16, 3).view(), path("wood.png"));
  write("paint.mtl",
        "newmtl wood\nKd 1 1 1\nmap_Kd wood.png\nnewmtl shiny\nKd 0.2 0.3 0.8\nKs 0.5 0.5 0.5\n"
        "Ns 30\nillum 2\n");
  write("model.obj",
        "mtllib paint.mtl\nv -1 0 -1\nv 1 0 -1\nv 1 0 1\nv -1 0 1\nv 0 1 0\nv 0 0.1 0.8\n"
        "vt 0 0\nvt 1 0\nvt 1 1\nvt 0 1\nusemtl wood\nf 4/1 3/2 2/3 1/4\n"
        "usemtl shiny\nf 1 5 6\nf 2 6 5\nf 1 2 5\n");
  for (const char* method : {"full", "adaptive"})
    render(method, path("model.obj"), {"--rig", rig("paper-64"), "--method", method}, 0, 1);
  expect_committed("obj", hashes_);
}

TEST_F(FramesStayEqual, OfEveryInstructionSetAndNumberOfThreads) {
  const std::string models = path("models");
  ASSERT_EQ(run_process({JUDGE_MODELS, models}).exit_code, 0);
  const char* threads = "1";
  for (const Isa isa : every_instruction_set()) {
    if (!isa_supported(isa)) continue;
    isa_ = isa_name(isa);
    for (const char* method : {"full", "adaptive"})
      for (const auto& [name, scene] : {std::pair{"balls:1", std::string("builtin:balls:1")},
                                        std::pair{"base-texture", models + "/base-texture.glb"}})
        render(fmt::format("{} {}", name, method), scene,
               {"--rig", rig("paper-64"), "--method", method, "--threads", threads}, 0, 1);
    threads = "3";
  }
  expect_committed("kernels", hashes_);
}

TEST_F(FramesStayEqual, OfEveryOptionAndRig) {
  for (const Words& option :
       {Words{"--soft-shadows", "4"}, Words{"--occlusion", "8"}, Words{"--samples", "4"},
        Words{"--prefilter", "beam"}, Words{"--prefilter", "exhaustive"}, Words{"--max-depth", "1"},
        Words{"--method", "adaptive", "--error", "8"},
        Words{"--method", "adaptive", "--psnr", "34"}}) {
    Words words = {"--rig", rig("paper-64")};
    words.insert(words.end(), option.begin(), option.end());
    render(fmt::format("{}", fmt::join(option, " ")), "builtin:room", words, 40, 1);
  }
  for (const char* name : {"tiny", "portrait", "kiosk-27-1080"})
    for (const char* method : {"full", "adaptive"})
      render(fmt::format("{} {}", name, method), "builtin:balls:1",
             {"--rig", rig(name), "--method", method}, 40, 1);
  expect_committed("options", hashes_);
}

TEST_F(FramesStayEqual, OfEveryPanelOfAWall) {
  std::string wall = "format = 1\nviewer_mm = [0, 0, 500]\n";
  for (const auto& [name, side] : {std::pair{"left", -1}, std::pair{"right", 1}})
    wall += fmt::format(
        "[[panel]]\nname = \"{}\"\nrig = \"{}\"\ncentre_mm = [{}, 0, 0]\nturn_degrees = {}\n", name,
        rig("tiny"), side * 12.5, side * -3);
  write("wall.toml", wall);
  for (const char* method : {"full", "adaptive"})
    for (const char* panel : {"left", "right"})
      render(fmt::format("{} {}", panel, method), "builtin:tree:1",
             {"--wall", path("wall.toml"), "--panel", panel, "--fit", "--method", method}, 40, 1);
  expect_committed("walls", hashes_);
}

/// A film of quilts is a video of a lossless codec.
TEST_F(FramesStayEqual, WovenAndPlayed) {
  run_well({"render", "builtin:tree:1", "-o", path("frame_%d.ppm"), "--frames", "40:43", "--rig",
            rig("tiny"), "--method", "full"});
  const std::string picture = path("frame_40.ppm"), pattern = path("frame_%d.ppm");
  for (const Words& layout :
       {Words{"--grid", "4x2", "--filter", "nearest"}, Words{"--grid", "4x2", "--filter", "gauss"},
        Words{"--grid", "4x2", "--crosstalk", "10"}, Words{"--stereo", "sbs"},
        Words{"--depth", "right"}}) {
    run_well(joined(
        {"weave", picture, "--overwrite", "--rig", rig("tiny"), "-o", path("woven.ppm")}, layout));
    note(fmt::format("weave {}", fmt::join(layout, " ")), "woven.ppm");
  }
  run_well({"convert", pattern, "--grid", "4x2", "-o", path("quilts.mkv")});
  run_well(
      {"convert", path("quilts_qs4x2a0.75.mkv"), "--rig", rig("tiny"), "-o", path("woven.lts")});
  note_film("woven from a video", "woven.lts", 0, 3);
  run_well({"play", path("frame_%d.ppm"), "--frames", "40:43", "--rig", rig("tiny"), "--fps", "30",
            "--display", "virtual", "--clock", "simulated", "--loop", "2", "--record",
            "checksums:" + path("shown.txt")});
  note("play", "shown.txt");
  // A film records the name of its source.
  run_well({"convert", "frame_%d.ppm", "--rig", rig("tiny"), "-o", path("film.lts")});
  note("film.lts", "film.lts");
  for (const char* film : {"film.lts", "film.mkv"}) {
    if (film != std::string("film.lts")) run_well({"convert", path("film.lts"), "-o", path(film)});
    run_well({"convert", path(film), "--overwrite", "-o", path("back_%d.ppm")});
    for (int frame = 0; frame < 3; ++frame)
      EXPECT_EQ(hash_of_file(path(fmt::format("back_{}.ppm", frame))),
                hash_of_file(path(fmt::format("frame_{}.ppm", 40 + frame))))
          << film;
  }
  expect_committed("commands", hashes_);
}

}  // namespace
}  // namespace lenticule::test
