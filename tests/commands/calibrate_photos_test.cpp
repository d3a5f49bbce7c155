// SPDX-License-Identifier: Apache-2.0
// Tests photograph folders from the patterns that the program writes to the rig that it finds. The
// simulated bench replaces the panel and the photographer.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include "frames/image_io.h"
#include "frames/srgb.h"
#include "lab/panel/trial.h"
#include "optics/rig_file.h"
#include "program.h"

namespace lenticule::test {
namespace {

using calib::CameraPicture;
using lab::SimulatedBench;
using lab::Trial;

constexpr int kPicturesUntilSettled = 3;

lab::Trial small_panel(double white_light) {
  lab::Trial trial = lab::plain_trial(960, 540, 640, 360);
  trial.camera.white_light = white_light;
  trial.link.response_ms = 1.0;
  trial.sheet.deformation_lenses = 0.04;
  return trial;
}

CameraPicture photographed(lab::SimulatedBench& bench, const frames::WovenFrame& pattern) {
  EXPECT_EQ(bench.sink().show(pattern.view(), std::chrono::seconds(1)), frames::ShowResult::Shown);
  CameraPicture picture;
  for (int n = 0; n < kPicturesUntilSettled; ++n)
    EXPECT_EQ(bench.camera().grab(picture, std::chrono::seconds(10)), calib::GrabStatus::Ready);
  return picture;
}

/// Encodes a picture as a camera stores it.
frames::WovenFrame coded(const CameraPicture& picture) {
  frames::WovenFrame frame({.width = picture.width, .height = picture.height});
  const auto step = static_cast<size_t>(picture.channels);
  uint8_t* to = frame.bytes().data();
  for (size_t pixel = 0; pixel < picture.light.size(); pixel += step, to += 3)
    for (size_t c = 0; c < 3; ++c)  // grey is encoded once
      to[c] = c < step ? frames::code_from_linear(double{picture.light[pixel + c]}) : to[0];
  return frame;
}

class PhotosCommand : public CommandTest {
 protected:
  explicit PhotosCommand(double white_light = 0.7) : trial_(small_panel(white_light)) {}
  void SetUp() override { optics::save_rig(trial_.start, path("start.toml")); }
  void write_patterns() const {
    expect_end(run({"calibrate", "photos", "--rig", path("start.toml"), "--write-patterns",
                    path("patterns")}),
               0);
  }
  /// Photographs all patterns; the camera is displaced by `by_mm` from picture `knocked` on.
  void photograph_all(const lab::TrialViewpoint& place, int knocked = -1, double by_mm = 0.0) {
    bench_.move_camera(place.position_mm, place.look_at_mm, place.roll_degrees);
    const std::filesystem::path folder = folder_ / place.name;
    std::filesystem::create_directories(folder);
    for (int n = 0;; ++n) {
      const std::string name = fmt::format("{:03}.png", n);
      if (!std::filesystem::exists(folder_ / "patterns" / name)) break;
      if (n == knocked)
        bench_.move_camera(place.position_mm + Vec3{by_mm, 0, 0},
                           place.look_at_mm + Vec3{by_mm, 0, 0}, place.roll_degrees);
      frames::write_woven(
          coded(photographed(bench_, frames::read_woven(folder_ / "patterns" / name))).view(),
          folder / name);
    }
  }
  [[nodiscard]] ProcessResult calibrate_centre(const std::string& rig,
                                               std::vector<std::string> more = {}) const {
    return run(joined(
        {"calibrate", "photos", path("centre"), "--rig", path(rig), "-o", path("found.toml")},
        more));
  }

  lab::Trial trial_;
  lab::SimulatedBench bench_{trial_.panel, trial_.sheet, trial_.link, trial_.camera, trial_.seed};
};

TEST_F(PhotosCommand, FindsTheSheetFromThreeFolders) {
  write_patterns();
  for (const lab::TrialViewpoint& place : trial_.viewpoints) photograph_all(place);
  std::vector<std::string> arguments = {"calibrate", "photos"};
  for (const lab::TrialViewpoint& place : trial_.viewpoints) arguments.push_back(path(place.name));
  for (const std::string& more :
       {std::string("--rig"), path("start.toml"), std::string("-o"), path("found.toml")})
    arguments.push_back(more);
  const ProcessResult found = run(arguments);
  ASSERT_EQ(found.exit_code, 0) << found.err << found.out;
  const optics::Rig rig = optics::load_rig(path("found.toml"));
  const lab::TrialErrors errors = lab::errors_of(rig, bench_, trial_);
  EXPECT_LT(errors.worst_lenses, 0.02);
  EXPECT_LT(std::abs(errors.pitch),
            4e-5);  // tolerance for a quarter of the lenses of a whole panel
  EXPECT_TRUE(std::filesystem::exists(path("found.report.html")));
  EXPECT_NE(found.out.find("Calibrated"), std::string::npos) << found.out;
}

TEST_F(PhotosCommand, RefusesPhotographsOfAnotherRigsPatterns) {
  write_patterns();
  photograph_all(trial_.viewpoints.front());
  optics::Rig other = trial_.start;
  other.sheet.pitch.value *= 0.994;
  optics::save_rig(other, path("other.toml"));
  expect_end(calibrate_centre("other.toml"), 4, optics::fingerprint(trial_.start));
  expect_end(calibrate_centre("other.toml", {"--patterns", path("patterns")}), 4, "patterns.json");
  EXPECT_FALSE(std::filesystem::exists(path("found.toml")));
}

TEST_F(PhotosCommand, RefusesADistanceThatThePhotographsContradict) {
  write_patterns();
  photograph_all(trial_.viewpoints.front());
  expect_end(calibrate_centre("start.toml", {"--distance", "700", "--pack", path("pack.tar")}), 0);
  const ProcessResult packed =
      run_process({"/bin/tar", "-xOf", path("pack.tar"), "calibration/README.txt"});
  EXPECT_NE(packed.out.find("--distance 700"), std::string::npos) << packed.out << packed.err;
  const ProcessResult wrong = calibrate_centre("start.toml", {"--distance", "1400"});
  EXPECT_EQ(wrong.exit_code, 5) << wrong.err << wrong.out;
  EXPECT_NE(wrong.out.find("not 1400 mm"), std::string::npos) << wrong.out;
}

TEST_F(PhotosCommand, NamesThePhotographAtWhichTheCameraMoved) {
  write_patterns();
  for (const double by_mm : {2.0, 0.7}) {
    photograph_all(trial_.viewpoints.front(), 40, by_mm);
    const ProcessResult result = calibrate_centre("start.toml");
    EXPECT_EQ(result.exit_code, 5) << by_mm << result.err << result.out;
    // The camera moved between 40 and 41; a large step is named one photograph late.
    const std::string text = result.out + result.err;
    EXPECT_TRUE(
        text.find("centre: the camera moved between photograph 40 and 41") != std::string::npos ||
        text.find("centre: the camera moved between photograph 41 and 42") != std::string::npos)
        << by_mm << result.err << result.out;
  }
}

class DimPanel : public PhotosCommand {
 protected:
  DimPanel() : PhotosCommand(0.035) {}
};

TEST_F(DimPanel, IsRefused) {
  write_patterns();
  photograph_all(trial_.viewpoints.front());
  expect_end(calibrate_centre("start.toml"), 5);
}

TEST_F(PhotosCommand, NamesAFolderWithoutPhotographs) {
  std::filesystem::create_directories(path("centre"));
  expect_end(run({"calibrate", "photos", path("centre"), "--rig", path("start.toml"), "-o",
                  path("found.toml")}),
             4, "centre");
  EXPECT_FALSE(std::filesystem::exists(path("found.toml")));
}

}  // namespace
}  // namespace lenticule::test
