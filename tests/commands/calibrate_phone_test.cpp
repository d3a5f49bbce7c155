// SPDX-License-Identifier: Apache-2.0
// Tests calibrate phone from the photographs in a folder to the rig that it finds. The simulated
// phone of lenticule-bench takes the photographs.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <csignal>
#include <filesystem>
#include <nlohmann/json.hpp>

#include "base/file.h"
#include "calib/photo/tag_chart.h"
#include "lab/phone/workshop.h"
#include "optics/rig_file.h"
#include "program.h"
#include "tests/support/small_workshop.h"

namespace lenticule::test {
namespace {

class PhoneCommand : public CommandTest {
 protected:
  void SetUp() override {
    std::filesystem::create_directories(path("inbox"));
    // A start that is more than 1 % off changes the chart after the first photograph.
    workshop_.start.sheet.pitch = Subpixels(1.004 * workshop_.build.pitch_subpx);
    optics::save_rig(workshop_.start, path("start.toml"));
  }
  void photograph_all() const {
    for (size_t n = 0; n < workshop_.shots.size(); ++n) photograph_one(n);
  }
  void photograph_one(size_t n) const {
    const frames::WovenFrame shown = calib::draw_single_photo_chart(
        calib::plan_single_photo_chart(optics::load_rig(path("start.toml"))));
    write_photo(photograph(sheet_, shown.view(), workshop_.phone, workshop_.shots[n]),
                workshop_.phone.jpeg_quality, path("inbox/" + std::to_string(n + 1) + ".jpg"));
  }
  [[nodiscard]] ProcessResult calibrate(std::vector<std::string> more,
                                        const ProcessLimits& limits = {}) const {
    return run(joined({"calibrate", "phone", path("inbox"), "--rig", path("start.toml"), "-o",
                       path("found.toml"), "--display", "virtual", "--seconds", "0"},
                      more),
               limits);
  }

  [[nodiscard]] std::string bytes_of(const std::string& name) const {
    return read_text_file(path(name), uint64_t{100} << 20);
  }

  lab::Workshop workshop_ = lab::draw_workshop(101, small_workshop(6));
  lab::SheetShape sheet_{workshop_.start.panel, workshop_.build};
};

TEST_F(PhoneCommand, EndsWithARigAPictureAndANumber) {
  photograph_all();
  const ProcessResult found = calibrate({"--existing", "--least", "6", "--minutes", "0.2"},
                                        {.timeout = std::chrono::seconds(300)});
  ASSERT_EQ(found.exit_code, 0) << found.err << found.out;
  const optics::Rig rig = optics::load_rig(path("found.toml"));
  EXPECT_LT(lab::worst_error(rig, sheet_, lab::judged_eyes(workshop_.start)), 0.02);
  EXPECT_TRUE(std::filesystem::exists(path("found.check.png")));
  EXPECT_TRUE(std::filesystem::exists(path("found.report.html")));
  for (const char* part :
       {"Right to 0.0", "lens anywhere in the viewing zone, which is 500 mm wide"})
    EXPECT_NE(found.out.find(part), std::string::npos) << found.out;
  EXPECT_NE(found.err.find("1. Photograph the whole panel"), std::string::npos) << found.err;
  EXPECT_NE(found.err.find("6.jpg: good"), std::string::npos) << found.err;
}

// All arrive one after the other, and each is fitted with those before it.
TEST_F(PhoneCommand, StatesItsProgressAndSetsAPhotographAsideThatSpoilsTheOthers) {
  photograph_all();
  const lab::Phone phone = workshop_.phone;
  workshop_.phone.focal *= 1.08;
  photograph_one(2);
  workshop_.phone = phone;
  const ProcessResult found =
      calibrate({"--existing", "--minutes", "0.2"}, {.timeout = std::chrono::seconds(300)});
  ASSERT_EQ(found.exit_code, 0) << found.err << found.out;
  EXPECT_NE(found.err.find("3.jpg: set aside: "), std::string::npos) << found.err;
  EXPECT_NE(found.err.find("3 photographs do not show whether the sheet moved"), std::string::npos)
      << found.err;
  EXPECT_NE(found.err.find(", then 0.0"), std::string::npos) << found.err;
  EXPECT_LT(lab::worst_error(optics::load_rig(path("found.toml")), sheet_,
                             lab::judged_eyes(workshop_.start)),
            0.02);
}

// Photographs that cannot be used are packed, too: they show why.
TEST_F(PhoneCommand, PacksThePhotographsWithTheCommandThatRepeatsTheCalibration) {
  workshop_.shots.resize(2);
  photograph_all();
  const ProcessResult refused =
      calibrate({"--existing", "--minutes", "0.1", "--json", "--pack", path("pack.tar")});
  expect_end(refused, 5);
  EXPECT_EQ(nlohmann::json::parse(refused.out).at("photographs").at(1).at("name"), "2.jpg");
  ASSERT_EQ(run_process({"/bin/tar", "-xf", path("pack.tar"), "-C", path("")}).exit_code, 0);
  EXPECT_EQ(bytes_of("calibration/01-1.jpg"), bytes_of("inbox/1.jpg"));
  EXPECT_EQ(bytes_of("calibration/02-2.jpg"), bytes_of("inbox/2.jpg"));
  EXPECT_EQ(optics::load_rig(path("calibration/start.toml")).sheet.pitch.value,
            workshop_.start.sheet.pitch.value);
  EXPECT_NE(bytes_of("calibration/report.json").find("\"refused\""), std::string::npos);
  EXPECT_NE(bytes_of("calibration/README.txt")
                .find("lenticule calibrate photos '01-1.jpg' '02-2.jpg' --rig start.toml"),
            std::string::npos);
}

// Photographs show angles alone: only a length that was measured shows that all of the rig are off.
TEST_F(PhoneCommand, ATapeThatContradictsThePanelsSizeIsNamed) {
  workshop_.shots.resize(2);
  photograph_all();
  const ProcessResult found = run(
      {"calibrate", "photos", path("inbox/1.jpg"), path("inbox/2.jpg"), "--rig", path("start.toml"),
       "-o", path("found.toml"), "--distance", std::to_string(1.06 * workshop_.shots[0].eye_mm.z)});
  EXPECT_NE(found.out.find("its size in the rig seems -"), std::string::npos)
      << found.out << found.err;
}

TEST_F(PhoneCommand, PlansTheChartAgainIfThePitchIsFarOff) {
  workshop_.start.sheet.pitch.value *= 1.02;
  optics::save_rig(workshop_.start, path("start.toml"));
  workshop_.shots.resize(1);
  photograph_all();
  expect_end(calibrate({"--existing", "--minutes", "0.1"}), 5, "the chart has changed");
}

TEST_F(PhoneCommand, NamesWhatCannotBeUsedAndGivesUpInTime) {
  write("inbox/notes.jpg", "no picture");
  expect_end(calibrate({"--existing", "--minutes", "0.03"}), 5, "notes.jpg: not used");
  EXPECT_FALSE(std::filesystem::exists(path("found.toml")));
}

TEST_F(PhoneCommand, AnInterruptionSavesNothing) {
  expect_end(
      calibrate({}, {.interrupt_signal = SIGINT, .interrupt_after = std::chrono::seconds(2)}), 130);
  EXPECT_FALSE(std::filesystem::exists(path("found.toml")));
}

/// A small panel, and a phone that films it while it is moved.
class PhoneFilm : public CommandTest {
 protected:
  static lab::Workshop small_panel() {
    lab::WorkshopLimits limits = lab::limits_for(1280, 1280);
    limits.shots = 1;
    lab::Workshop workshop = lab::draw_workshop(kSeed, limits);
    workshop.start.sheet.pitch = Subpixels(1.003 * workshop.build.pitch_subpx);
    lab::make_film_camera(kSeed, 1280, workshop.phone);
    return workshop;
  }
  /// Films ten pictures a second with the program ffmpeg: three at each place, then a dark one.
  void film(const std::string& name, int places) const {
    const frames::WovenFrame shown =
        calib::draw_single_photo_chart(calib::plan_single_photo_chart(workshop_.start));
    const lab::Sweep sweep(kSeed, workshop_);
    std::string codes;
    for (int place = 0; place < places; ++place)
      for (const int tick : {-1, 0, 1, 2}) {
        lab::Photo photo;
        photo.codes.assign(static_cast<size_t>(workshop_.phone.width) *
                               static_cast<size_t>(workshop_.phone.height) * 3,
                           40);
        if (tick < 2) {
          lab::Shot shot = sweep.at(sweep.seconds() * (place + 0.5) / places + 0.1 * tick);
          shot.exposure_s = 0.0;
          photo = photograph(sheet_, shown.view(), workshop_.phone, shot);
        }
        codes.append(photo.codes.begin(), photo.codes.end());
      }
    write("raw", codes);
    expect_end(run_process({"/bin/sh", "-c",
                            fmt::format("exec ffmpeg -v error -nostdin -y -f rawvideo -pix_fmt "
                                        "rgb24 -s {}x{} -r 10 -i {} -c:v libx264 -crf 18 -vf "
                                        "scale=out_color_matrix=bt709 -colorspace bt709 -pix_fmt "
                                        "yuv420p {}",
                                        workshop_.phone.width, workshop_.phone.height, path("raw"),
                                        path(name))}),
               0);
  }

  static constexpr uint64_t kSeed = 20003;
  lab::Workshop workshop_ = small_panel();
  lab::SheetShape sheet_{workshop_.start.panel, workshop_.build};
};

TEST_F(PhoneFilm, GivesARigForEveryEye) {
  optics::save_rig(workshop_.start, path("start.toml"));
  film("film.mp4", 8);
  const std::vector<std::string> from = {"--rig", path("start.toml"), "-o", path("found.toml")};
  const ProcessResult found = run(joined({"calibrate", "phone", path("film.mp4"), "--json"}, from),
                                  {.timeout = std::chrono::seconds(300)});
  EXPECT_NE(found.err.find("film.mp4: 32 frames looked at, "), std::string::npos) << found.err;
  const nlohmann::json report = results_of(found);
  EXPECT_GE(report["film"]["used_at_s"].size(), 6U) << report["film"];
  EXPECT_EQ(report["photographs"][0]["name"].get<std::string>().substr(0, 12), "film.mp4 at ");
  EXPECT_LT(lab::worst_error(optics::load_rig(path("found.toml")), sheet_,
                             lab::judged_eyes(workshop_.start)),
            0.02);
  write("1.jpg", "");
  expect_end(run(joined({"calibrate", "photos", path("film.mp4"), path("1.jpg")}, from)), 2,
             "a film is not mixed with other files");
}

TEST_F(PhoneCommand, AMissingFolderIsNamed) {
  std::filesystem::remove(path("inbox"));
  expect_end(calibrate({}), 4, "inbox");
}

}  // namespace
}  // namespace lenticule::test
