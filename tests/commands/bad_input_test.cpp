// SPDX-License-Identifier: Apache-2.0
// Checks that the program answers every bad file and argument with one or two clear lines and the
// documented exit code, without a crash and without partial files.

#include <algorithm>

#include "tests/commands/program.h"
#include "tests/support/scratch_folder.h"

namespace lenticule::test {
namespace {

constexpr const char* kTinyRig = R"(format = 1
name = "tiny"
[panel]
width_px = 48
height_px = 32
pixel_width_mm = 0.2
pixel_height_mm = 0.2
layout = "rgb"
[sheet]
pitch_subpx = 7.5
slant = 0.2
offset_lenses = 0.1
gap_mm = 1.0
refraction_shape = 0.45
[viewing]
distance_mm = 600.0
height_mm = 0.0
)";

constexpr const char* kTinyScene = R"(b 0.1 0.2 0.3
v
from 0 0 5
at 0 0 0
up 0 1 0
angle 40
hither 0.1
resolution 64 64
l 3 4 5
f 0.9 0.5 0.3 0.8 0.2 10 0 1
s 0 0 0 1
)";

class BadInput : public CommandTest {
 protected:
  void SetUp() override {
    write("rig.toml", kTinyRig);
    write("scene.nff", kTinyScene);
  }

  /// Writes the rig with one text replaced by another.
  void write_rig(const std::string& from, const std::string& to) const {
    std::string text = kTinyRig;
    const size_t at = text.find(from);
    ASSERT_NE(at, std::string::npos) << from;
    text.replace(at, from.size(), to);
    write("bad.toml", text);
  }

  [[nodiscard]] ProcessResult render(const std::string& scene, const std::string& rig,
                                     const std::string& out,
                                     const ProcessLimits& limits = {}) const {
    return run({"render", scene, "--rig", rig, "--method", "full", "-o", out}, limits);
  }

  /// Expects an error of one or two lines that names `object`, and the given exit code.
  static void expect_clear_error(const ProcessResult& result, int exit_code,
                                 const std::string& object) {
    EXPECT_EQ(result.exit_code, exit_code) << result.err;
    EXPECT_EQ(result.signal, 0) << result.err;
    EXPECT_FALSE(result.timed_out);
    const size_t start = result.err.find("lenticule: ");
    ASSERT_NE(start, std::string::npos) << result.err;
    const std::string message = result.err.substr(start);
    EXPECT_LE(std::count(message.begin(), message.end(), '\n'), 2) << message;
    EXPECT_NE(message.find(object), std::string::npos) << message;
  }
};

TEST_F(BadInput, RendersUndamagedInputs) {
  expect_end(render(path("scene.nff"), path("rig.toml"), path("out.png")), 0);
  EXPECT_TRUE(std::filesystem::exists(path("out.png")));
}

TEST_F(BadInput, NamesMissingFiles) {
  expect_clear_error(render(path("none.nff"), path("rig.toml"), path("o.png")), 4, "none.nff");
  expect_clear_error(render(path("scene.nff"), path("none.toml"), path("o.png")), 4, "none.toml");
  expect_clear_error(run({"play", path("none-%03d.png"), "--rig", path("rig.toml")}), 4, "none-");
  expect_clear_error(run({"eye", path("none.png"), "--rig", path("rig.toml"), "--eye", "0,0,600",
                          "-o", path("o.png")}),
                     4, "none.png");
  expect_clear_error(run({"compare", path("none.png"), path("none.png")}), 4, "none.png");
  expect_clear_error(run({"rig", "check", path("none.toml")}), 4, "none.toml");
  EXPECT_EQ(listing(), (std::vector<std::string>{"rig.toml", "scene.nff"}));
}

TEST_F(BadInput, RefusesToPlayWithoutACalibration) {
  ASSERT_EQ(render(path("scene.nff"), path("rig.toml"), path("film.png")).exit_code, 0);
  const std::string record = "png:" + path("shown");
  const ProcessResult none = run({"play", path("film.png"), "--record", record});
  expect_end(none, 4, "no --rig: using the sample ");
  expect_clear_error(
      run({"play", path("film.png"), "--rig", path("none.toml"), "--record", record}), 4,
      "none.toml");
  write_rig("pitch_subpx = 7.5\n", "");
  expect_clear_error(run({"play", path("film.png"), "--rig", path("bad.toml"), "--record", record}),
                     4, "pitch_subpx");
  EXPECT_FALSE(std::filesystem::exists(path("shown"))) << "something was shown";
}

TEST_F(BadInput, RefusesImpossibleRigsAndNamesFileAndKey) {
  const auto check = [this] { return run({"rig", "check", path("bad.toml")}); };
  for (const char* pitch : {"0.0", "-7.5", "nan", "inf", "1e300", "1e-300"}) {
    write_rig("pitch_subpx = 7.5", std::string("pitch_subpx = ") + pitch);
    expect_clear_error(check(), 4, "pitch_subpx");
  }
  for (const char* width : {"0", "-48", "1000000000", "99999999999999999999", "48.5"}) {
    write_rig("width_px = 48", std::string("width_px = ") + width);
    expect_clear_error(check(), 4, "bad.toml");
  }
  write_rig("pitch_subpx = 7.5", "pich_subpx = 7.5");
  expect_clear_error(check(), 4, "bad.toml:10:");
  expect_clear_error(check(), 4, "pitch_subpx");  // the nearest key
  for (const std::string& text : {std::string(), std::string("["), std::string(100000, '['),
                                  std::string("\0\xff\xfe", 3), std::string("format = 99\n")}) {
    write("bad.toml", text);
    expect_clear_error(check(), 4, "bad.toml");
  }
}

TEST_F(BadInput, RefusesTruncatedPictures) {
  ASSERT_EQ(render(path("scene.nff"), path("rig.toml"), path("whole.png")).exit_code, 0);
  const std::string whole = read_text(path("whole.png"));
  for (const size_t keep :
       {size_t{0}, size_t{7}, size_t{40}, whole.size() / 2, whole.size() - 20}) {
    write("cut-001.png", whole.substr(0, keep));
    expect_clear_error(run({"eye", path("cut-001.png"), "--rig", path("rig.toml"), "--eye",
                            "0,0,600", "-o", path("o.png")}),
                       4, "cut-001.png");
    expect_clear_error(
        run({"play", path("cut-%03d.png"), "--rig", path("rig.toml"), "--display", "virtual"}), 4,
        "cut-001.png");
  }
  EXPECT_FALSE(std::filesystem::exists(path("o.png")));
}

TEST_F(BadInput, RefusesAFrameForAnotherPanel) {
  ASSERT_EQ(render(path("scene.nff"), path("rig.toml"), path("f-001.png")).exit_code, 0);
  write_rig("width_px = 48", "width_px = 60");
  expect_clear_error(run({"play", path("f-%03d.png"), "--rig", path("bad.toml")}), 4, "48");
  expect_clear_error(run({"eye", path("f-001.png"), "--rig", path("bad.toml"), "--eye", "0,0,600",
                          "-o", path("o.png")}),
                     4, "48");
}

TEST_F(BadInput, RefusesScenesWithNonFiniteNumbers) {
  std::string text = kTinyScene;
  text.replace(text.find("s 0 0 0 1"), 9, "s nan 0 0 1");
  write("nan.nff", text);
  expect_clear_error(render(path("nan.nff"), path("rig.toml"), path("o.png")), 4, "nan.nff:11");
  write("nan.obj", "v 0 0 0\nv 1 0 0\nv nan 1 0\nf 1 2 3\n");
  expect_clear_error(render(path("nan.obj"), path("rig.toml"), path("o.png")), 4, "nan.obj");
}

TEST_F(BadInput, RefusesEmptyAndUnknownScenes) {
  std::string text = kTinyScene;
  text.resize(text.find("s 0 0 0 1"));
  write("empty.nff", text);
  expect_clear_error(render(path("empty.nff"), path("rig.toml"), path("o.png")), 4, "empty.nff");
  write("empty.obj", "# nothing\n");
  expect_clear_error(render(path("empty.obj"), path("rig.toml"), path("o.png")), 4, "empty.obj");
  write("unknown.xyz", "what is this");
  expect_clear_error(render(path("unknown.xyz"), path("rig.toml"), path("o.png")), 4,
                     "unknown.xyz");
  write("words.nff", "hello\n");
  expect_clear_error(render(path("words.nff"), path("rig.toml"), path("o.png")), 4, "words.nff:1");
}

TEST_F(BadInput, SaysWhyThereIsNothingToSee) {
  write("points.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\np 1 2 3\n");
  expect_clear_error(render(path("points.obj"), path("rig.toml"), path("o.png")), 4,
                     "nothing to see in this scene: points and lines left out");
  write("flat.obj", "v 0 0 0\nv 1 0 0\nv 2 0 0\nf 1 2 3\n");
  expect_clear_error(render(path("flat.obj"), path("rig.toml"), path("o.png")), 4,
                     "nothing to see in this scene: 1 triangles without an area dropped");
  std::string text = kTinyScene;
  text.replace(text.find("at 0 0 0"), 8, "at 0 0 9");
  write("away.nff", text);
  expect_clear_error(render(path("away.nff"), path("rig.toml"), path("o.png")), 4,
                     "away.nff: nothing to see in this scene: all of it lies outside the camera's");
  EXPECT_FALSE(std::filesystem::exists(path("o.png")));
  // The remedies that the message names succeed: --fit moves the scene into view, and --sky alone
  // fills the picture.
  for (const char* flag : {"--fit", "--sky"}) {
    expect_end(run({"render", path("away.nff"), "--rig", path("rig.toml"), flag, "-o",
                    path("o.png"), "--overwrite"}),
               0);
  }
  const ProcessResult beside =
      run({"render", path("scene.nff"), "--rig", path("rig.toml"), "--fit", "--mm-per-unit", "1",
           "--centre", "500,0,0", "-o", path("p.png")});
  expect_clear_error(beside, 4, "all of it lies outside the panel");
}

TEST_F(BadInput, NamesAllMissingFlagsAndTheCommand) {
  const ProcessResult both = run({"render", "my model.glb", "--samples", "4"});
  expect_clear_error(both, 2, "render: -o is missing");
  const auto has = [&](const std::string& text) {
    EXPECT_NE(both.err.find(text), std::string::npos) << text << ": " << both.err;
  };
  has("lenticule render 'my model.glb'");
  has(" --samples 4");
  has(" -o woven.png");
  expect_clear_error(run({"render"}), 2, "render: SCENE and -o are missing");
  expect_clear_error(run({"render", path("scene.nff"), "--rig", path("rig.toml")}), 2,
                     "for example: lenticule render " + path("scene.nff") + " --rig " +
                         path("rig.toml") + " -o woven.png");
  expect_clear_error(run({"eye", "frame.png", "-o", "left.png"}), 2, "--eye is missing");
}

TEST_F(BadInput, ScenesOfAnySizeRender) {
  for (const char* scale : {"1e-6", "1e6"}) {
    write("sized.obj", std::string("v 0 0 0\nv ") + scale + " 0 0\nv 0 " + scale + " 0\nf 1 2 3\n");
    expect_end(render(path("sized.obj"), path("rig.toml"), path("sized.png")), 0);
  }
}

TEST_F(BadInput, ReportsOutputThatCannotBeWritten) {
  expect_clear_error(render(path("scene.nff"), path("rig.toml"), path("no/such/folder/o.png")), 1,
                     "no/such/folder");
  expect_clear_error(render(path("scene.nff"), path("rig.toml"), path("scene.nff/o.png")), 1,
                     "scene.nff");
  expect_clear_error(render(path("scene.nff"), path("rig.toml"), "/proc/o.png"), 1, "/proc");
  expect_clear_error(render(path("scene.nff"), path("rig.toml"), path("o.unknown")), 2,
                     "o.unknown");
  expect_clear_error(run({"render", path("scene.nff"), "--rig", path("rig.toml"), "--frames", "0:3",
                          "-o", path("same.png")}),
                     2, "same.png");
}

TEST_F(BadInput, AFullDiskLeavesNoPartialFiles) {
  const auto before = listing();
  const ProcessLimits full{.largest_file_bytes = 256};
  // A built-in scene needs no reader, whose memory would be limited, too.
  expect_clear_error(render("builtin:demo", path("rig.toml"), path("o.png"), full), 1, "o.png");
  expect_clear_error(run({"scene", "teapot", "-o", path("o.nff")}, full), 1, "o.nff");
  expect_clear_error(
      run({"rig", "export", path("rig.toml"), "--format", "lkg", "-o", path("o.json")},
          {.largest_file_bytes = 16}),
      1, "o.json");
  EXPECT_EQ(listing(), before);
}

TEST_F(BadInput, RefusesInvalidArguments) {
  const auto usage = [&](std::vector<std::string> extra) {
    expect_end(
        run(joined({"render", path("scene.nff"), "--rig", path("rig.toml"), "-o", path("o.png")},
                   extra)),
        2);
    EXPECT_FALSE(std::filesystem::exists(path("o.png")));
  };
  usage({"--method", "magic"});
  usage({"--up", "north"});
  usage({"--frames", "5:2"});
  usage({"--frames", "-3:2"});
  usage({"--frames", "zero"});
  usage({"--samples", "0"});
  usage({"--soft-shadows", "-1"});
  usage({"--soft-shadows", "10000"});
  usage({"--soft-shadows", "4", "--light-size", "nan"});
  usage({"--soft-shadows", "4", "--sun-size", "90"});
  usage({"--light-size", "3"});
  usage({"--occlusion", "4", "--occlusion-distance", "0"});
  usage({"--occlusion", "4", "--environment-light", "4"});
  usage({"--threads", "-1"});
  usage({"--mm-per-unit", "0"});
  usage({"--depth-scale", "nan"});
  usage({"--pitch", "91"});
  usage({"--turn", "right"});
  usage({"--turn", "0:360"});
  usage({"--fit", "--camera", path("none.camera")});
  expect_clear_error(
      run({"play", path("o-%03d.png"), "--rig", path("rig.toml"), "--display", "virtual:0x0@60"}),
      2, "virtual");
  expect_clear_error(run({"play", path("o-%03d.png"), "--rig", path("rig.toml"), "--fps", "-1"}), 2,
                     "-1");
}

TEST_F(BadInput, RefusesFlagsWithoutEffect) {
  const auto refused = [&](std::vector<std::string> extra, const std::string& object) {
    expect_clear_error(
        run(joined({"render", path("scene.nff"), "--rig", path("rig.toml"), "-o", path("o.png")},
                   extra)),
        2, object);
    EXPECT_FALSE(std::filesystem::exists(path("o.png")));
  };
  for (const char* method : {"full", "lens-view", "interpolate", "temporal", "hybrid"})
    refused({"--method", method, "--error", "2"}, "--error");
  refused({"--error", "2"}, "--error");
  refused({"--psnr", "40"}, "--psnr");
  refused({"--method", "adaptive", "--psnr", "400"}, "--psnr");
  refused({"--method", "adaptive", "--psnr", "40", "--soft-shadows", "8"}, "--psnr");
  refused({"--method", "adaptive", "--adapt-error", "10"}, "--adapt-error: files are not live");
  refused({"--adapt-error", "10"}, "--adapt-error: method full");
  refused({"--method", "adaptive", "--adapt-error", "10", "--error", "1"}, "--adapt-error");
  expect_clear_error(run({"render", path("scene.nff"), "--rig", path("rig.toml"), "--method",
                          "adaptive", "--adapt-error", "0", "-o", "ring:" + path("ring")}),
                     2, "--adapt-error 0");
  refused({"--prefilter-samples", "5"}, "--prefilter-samples");
  for (const char* method : {"adaptive", "lens-view", "interpolate", "temporal", "hybrid"}) {
    refused({"--method", method, "--samples", "4"}, "sample");
    refused({"--method", method, "--prefilter", "beam"}, "prefilter");
  }
  for (const char* method : {"full", "adaptive"})
    refused({"--method", method, "--missing", path("m.png")}, "--missing");
}

TEST_F(BadInput, NamesTheRemedyOfLikelyMistakes) {
  const auto write_picture = [this](const std::string& name, int width, int height) {
    write(name, "P6\n" + std::to_string(width) + " " + std::to_string(height) + "\n255\n" +
                    std::string(size_t(width) * size_t(height) * 3, 'x'));
  };
  write_picture("flat.ppm", 64, 36);
  write_picture("wide.ppm", 128, 36);
  write_picture("00001.ppm", 48, 32);
  write("notes.txt", "hello");
  write("film.lts", "\x89LTS\r\n\x1a\n");
  write("model.obj", "v 0 0 0\n");
  write("photo.glb", "\x89PNG\r\n\x1a\n");
  write("photo.png", "\x89PNG\r\n\x1a\n");
  write("empty.glb", "");
  const std::string film = path("film.lts"), model = path("model.obj");
  const std::string rig = path("rig.toml"), scene = path("scene.nff");
  struct Case {
    std::vector<std::string> words;
    int exit_code;
    const char* cause;
    const char* remedy;
  };
  const auto play = [&](const std::string& source, std::vector<std::string> more = {}) {
    const std::vector<std::string> words =
        joined({"play", source, "--rig", rig, "--display", "virtual"}, more);
    return words;
  };
  for (const Case& one : std::vector<Case>{
           {play(path("flat.ppm")), 4, "64x36 pixels", "--grid 1x1, or _qs1x1 in its name"},
           {play(path("wide.ppm")), 4, "128x36 pixels", "--stereo sbs, or _sbs in its name"},
           {play(path("%03d.ppm")), 4, "no such files", "%05d.ppm"},
           {play(path("notes.txt")), 4, "not a picture", "save it again as PNG"},
           {play(model), 4, "a model, not a picture", "lenticule render MODEL"},
           {{"convert", model, "-o", "a.png"}, 4, "a model, not", "lenticule render MODEL"},
           {{"compare", film, film}, 4, "a film, not a picture", "lenticule convert FILM --frames"},
           {{"eye", film, "--rig", rig, "--eye", "0,0,600", "-o", "b.png"},
            4,
            "a film, not a picture",
            "lenticule convert FILM --frames"},
           {{"scene", "show", path("photo.glb")}, 4, "photo.glb: a picture", "rename it"},
           {{"scene", "show", path("photo.png")}, 4, "not a model", "lenticule play"},
           {{"scene", "show", path("empty.glb")}, 4, "empty.glb: empty", "copy it anew"},
           {play("https://example.org/a.png"), 4, "cannot read", "download it first"},
           {play("no.lts"), 4, "cannot read", "the current folder is "},
           {play("card", {"--fps", "0"}), 2, "rate 0/1", "1/3600 to 10000 frames per second"},
           {play("card", {"--duration", "0,5"}), 2, "'0,5': expected a number above 0", "a point"},
           {play("card", {"--slots", "1"}), 2, "expected a whole number from 2 to 4096", "--help"},
           {play("card", {"--slots", "8", "--slots", "9"}), 2, "given more than once", "--help"},
           {play("card", {"--json=abc"}), 2, "--json: takes no value", "--help"},
           {play("card", {"--clock", "x"}), 2, "expected one of real,simulated", "--help"},
           {{"play", "card", "--rig"}, 2, "--rig: its value is missing", "--help"},
           {{"play", "-dash.lts", "--rig", rig}, 2, "no flag '-dash.lts'", "./-dash.lts"},
           {{"--rig", rig, "play", "card"}, 2, "no flag '--rig'", "after the command"},
           {{"play"}, 2, "play: SOURCE is missing", "for example: lenticule play film.lts"},
           {{rig}, 2, "no command", "lenticule play "},
           {{"render", scene, "--rig", rig, "-o", "x.mp4"}, 2, "-o x.mp4", "use FILE.lts"},
           {{"render", scene, "--rig", rig, "-o", "x.LTS"}, 2, "-o x.LTS", "use FILE.lts"},
           {{"eye", "a.png", "--rig", rig, "--eye", "0,0", "-o", "b.png"},
            2,
            "not three numbers",
            "--eye -32,0,700"},
           {{"rig", "show", path("notes.txt")}, 4, "notes.txt:1", "name another file"},
           {{"rig", "import", path("notes.txt"), "-o", "r.toml"}, 4, "not JSON: parse", "correct"},
           {{"ctl", "stop"}, 2, "no command 'stop'", "did you mean 'quit'?"},
           {{"ctl", "--socket", path("none"), "status"}, 3, "no player", "start one"},
           {{"ctl", "--socket", rig, "status"},
            3,
            "it is a regular file, not a socket",
            "--control"},
           {{"ctl", "--socket", folder_.string(), "status"},
            3,
            "a folder, not a socket",
            "--control"},
       }) {
    const ProcessResult result = run(one.words);
    expect_clear_error(result, one.exit_code, one.cause);
    EXPECT_NE(result.err.find(one.remedy), std::string::npos) << result.err;
  }
}

TEST_F(BadInput, AMissingDisplayIsADeviceError) {
  ASSERT_EQ(render(path("scene.nff"), path("rig.toml"), path("f-001.png")).exit_code, 0);
  expect_clear_error(
      run({"play", path("f-%03d.png"), "--rig", path("rig.toml"), "--display", "kms"}), 3, "kms");
  expect_clear_error(run({"render", path("scene.nff"), "--rig", path("rig.toml"), "-o",
                          "ring:" + path("nobody.sock")}),
                     3, "nobody.sock");
}

}  // namespace
}  // namespace lenticule::test
