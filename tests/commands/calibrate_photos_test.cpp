// SPDX-License-Identifier: Apache-2.0
// Folders of photographs, from the patterns that the program writes to the rig that it finds; the
// simulated bench stands for the panel and the photographer.
#include <gtest/gtest.h>

#include <fstream>

#include "calib/simulation/trial.h"
#include "frames/image_io.h"
#include "frames/srgb.h"
#include "optics/rig_file.h"
#include "program.h"

namespace lenticule::test {
namespace {

using calib::CameraPicture;
using calib::SimulatedBench;
using calib::Trial;

constexpr int kPicturesUntilSettled = 3;

Trial small_panel() {
  Trial trial = calib::plain_trial(960, 540, 640, 360);
  trial.link.response_ms = 1.0;
  trial.sheet.deformation_lenses = 0.04;
  return trial;
}

CameraPicture photographed(SimulatedBench& bench, const frames::WovenFrame& pattern) {
  EXPECT_EQ(bench.sink().show(pattern.view(), std::chrono::seconds(1)), frames::ShowResult::Shown);
  CameraPicture picture;
  for (int n = 0; n < kPicturesUntilSettled; ++n)
    EXPECT_EQ(bench.camera().grab(picture, std::chrono::seconds(10)), calib::GrabStatus::Ready);
  return picture;
}

/// As a camera stores it.
frames::WovenFrame coded(const CameraPicture& picture) {
  frames::WovenFrame frame({.width = picture.width, .height = picture.height});
  for (int y = 0; y < picture.height; ++y)
    for (int k = 0; k < 3 * picture.width; ++k) {
      const size_t pixel = static_cast<size_t>(y * picture.width + k / 3);
      const size_t channel = picture.channels == 3 ? static_cast<size_t>(k % 3) : 0;
      const size_t at = pixel * static_cast<size_t>(picture.channels) + channel;
      frame.row(y)[k] = frames::code_from_linear(double{picture.light[at]});
    }
  return frame;
}

class PhotosCommand : public CommandTest {
 protected:
  void photograph_all(const calib::TrialViewpoint& place) {
    bench_.move_camera(place.position_mm, place.look_at_mm, place.roll_degrees);
    const std::filesystem::path folder = folder_ / place.name;
    std::filesystem::create_directories(folder);
    for (const auto& entry : std::filesystem::directory_iterator(folder_ / "patterns"))
      frames::write_woven(coded(photographed(bench_, frames::read_woven(entry.path()))).view(),
                          folder / entry.path().filename());
  }

  Trial trial_ = small_panel();
  SimulatedBench bench_{trial_.panel, trial_.sheet, trial_.link, trial_.camera, trial_.seed};
};

TEST_F(PhotosCommand, FoldersFromThreePlacesFindTheSheet) {
  optics::save_rig(trial_.start, path("start.toml"));
  const ProcessResult wrote = run(
      {"calibrate", "photos", "--rig", path("start.toml"), "--write-patterns", path("patterns")});
  ASSERT_EQ(wrote.exit_code, 0) << wrote.err;
  for (const calib::TrialViewpoint& place : trial_.viewpoints) photograph_all(place);
  std::vector<std::string> arguments = {"calibrate", "photos"};
  for (const calib::TrialViewpoint& place : trial_.viewpoints)
    arguments.push_back(path(place.name));
  for (const std::string& more :
       {std::string("--rig"), path("start.toml"), std::string("-o"), path("found.toml")})
    arguments.push_back(more);
  const ProcessResult found = run(arguments);
  ASSERT_EQ(found.exit_code, 0) << found.err << found.out;
  const optics::Rig rig = optics::load_rig(path("found.toml"));
  const calib::TrialErrors errors = calib::errors_of(rig, bench_, trial_);
  EXPECT_LT(errors.worst_lenses, 0.02);
  EXPECT_LT(std::abs(errors.pitch), 4e-5);  // a quarter of the lenses of a whole panel
  EXPECT_TRUE(std::filesystem::exists(path("found.report.html")));
  EXPECT_NE(found.out.find("Calibrated"), std::string::npos) << found.out;
}

TEST_F(PhotosCommand, APatternThatNobodyPhotographedIsNamed) {
  optics::save_rig(trial_.start, path("start.toml"));
  std::filesystem::create_directories(path("centre"));
  const ProcessResult result = run({"calibrate", "photos", path("centre"), "--rig",
                                    path("start.toml"), "-o", path("found.toml")});
  EXPECT_EQ(result.exit_code, 4) << result.err;
  EXPECT_NE(result.err.find("centre"), std::string::npos) << result.err;
  EXPECT_FALSE(std::filesystem::exists(path("found.toml")));
}

}  // namespace
}  // namespace lenticule::test
