// SPDX-License-Identifier: Apache-2.0
// Tests the sequence of photographs beside a fake player and a fake program. What a photograph file
// contains is what the program says about it: "good", "worse" (with it the fit is worse), "broken"
// (no picture), or the reason why it is not used.
#include "apps/lenticule-web/api/photo_calibration.h"

#include <gtest/gtest.h>

#include <fstream>
#include <set>

#include "tests/support/scratch_folder.h"
#include "tests/unit/web/fake_player.h"

namespace lenticule::web {
namespace {

using nlohmann::ordered_json;

constexpr const char* kProgram = R"sh(#!/bin/sh
if [ "$2" = show ]; then
  for last; do :; done
  echo chart > "$last"
  exit 0
fi
shift 2
count=0 list= error=
while [ $# -gt 0 ]; do
  case $1 in
    --rig) rig=$2; shift ;;
    -o) out=$2; shift ;;
    --largest-error) shift ;;
    --*) ;;
    *)
      count=$((count + 1))
      what=$(cat "$1")
      if [ "$what" = broken ]; then echo "lenticule: $1: is no picture" >&2; exit 4; fi
      used=true reason=
      case $what in
        good) ;;
        worse) error=0.09 ;;
        *) used=false reason=$what bad=$what ;;
      esac
      list="$list${list:+,} {\"name\": \"${1##*/}\", \"used\": $used, \"reason\": \"$reason\",
        \"eye_mm\": [$count, 0, 700], \"roll_degrees\": 0}" ;;
  esac
  shift
done
case $count in
  1) most=1 usual=0.4 ;;
  2) most=0.05 usual=0.08 ;;
  3) most=0.05 usual=0.03 ;;
  *) most=0.05 usual=0.018 ;;
esac
error=${error:-$usual}
saved=$(awk "BEGIN { print ($error <= $most && \"$bad\" == \"\") ? 1 : 0 }")
[ $saved = 1 ] && cp "$rig" "$out"
printf '{\n"verdict": "effective", "reasons": ["%s"], "warnings": [], "advice": [],
 "parameters": [], "drift": {"worst_lenses": %s}, "photographs": [%s],
 "viewpoints": [%s]}\n' "${bad:-too large an error}" "$error" "$list" "$list"
[ $saved = 1 ] || exit 5
)sh";

class PhotoCalibrationTest : public testing::Test {
 protected:
  void SetUp() override {
    std::ofstream(folder_ / "program") << kProgram;
    std::filesystem::permissions(folder_ / "program", std::filesystem::perms::owner_all);
    calibration_ = std::make_unique<PhotoCalibration>(
        link_, pictures_,
        PhotoCalibrationOptions{.folder = folder_ / "calibration",
                                .program = folder_ / "program",
                                .stops = [] { return false; },
                                .history = folder_ / "rigs.json"});
  }
  /// Sends a photograph and returns the state after it.
  ordered_json send(const std::string& what, std::optional<std::string> place = {}) {
    const auto sink = calibration_->photograph(place);
    sink->take({reinterpret_cast<const uint8_t*>(what.data()), what.size()});
    return ordered_json::parse(sink->finish().body);
  }
  /// Returns the names of the photographs in the folder.
  [[nodiscard]] std::set<std::string> files() const {
    std::set<std::string> names;
    for (const auto& entry : std::filesystem::recursive_directory_iterator(folder_ / "calibration"))
      if (entry.path().extension() == ".jpg") names.insert(entry.path().filename());
    return names;
  }
  static int basis(const ordered_json& state) { return state["result"]["photographs"]; }

  test::ScratchFolder folder_;
  test::FakePlayer player_{folder_ / "c.sock"};
  ControlLink link_{folder_ / "c.sock"};
  PictureMaker pictures_{link_};
  std::unique_ptr<PhotoCalibration> calibration_;
};

TEST_F(PhotoCalibrationTest, NeedsTheChart) {
  EXPECT_THROW((void)calibration_->photograph({}), HttpError);
  calibration_->begin();
  EXPECT_NO_THROW((void)calibration_->photograph({}));
  calibration_->discard();
  EXPECT_THROW((void)calibration_->photograph({}), HttpError);
}

TEST_F(PhotoCalibrationTest, ASmallerErrorOfMorePhotographsReplacesTheResultOfTheFirst) {
  calibration_->begin();
  ordered_json state = send("good");
  EXPECT_EQ(state["stage"], "found");
  EXPECT_EQ(state["fit"]["stated_lenses"], nullptr);
  state = send("good");
  EXPECT_EQ(state["stage"], "found");
  EXPECT_EQ(basis(state), 1) << "0.08 lens is too much";
  EXPECT_EQ(state["fit"]["stated_lenses"], 0.08);
  state = send("good");
  EXPECT_EQ(basis(state), 3);
  EXPECT_EQ(state["fit"]["stated_lenses"], 0.03);
  EXPECT_EQ(state["next"], "right-again");
  state = send("good");
  EXPECT_EQ(basis(state), 4);
  EXPECT_EQ(state["next"], nullptr);
  EXPECT_EQ(files(),
            (std::set<std::string>{"left.jpg", "middle.jpg", "right-again.jpg", "right.jpg"}));
  calibration_->keep("desk");
  EXPECT_EQ(files(), std::set<std::string>());
  EXPECT_EQ(calibration_->state()["history"][0]["what"], "4 photographs");
}

TEST_F(PhotoCalibrationTest, ARefusedPhotographLeavesEverythingElseAsItWas) {
  calibration_->begin();
  EXPECT_EQ(send("only 2 of 9 tags were found")["stage"], "refused");
  for (int n = 0; n < 3; ++n) (void)send("good");
  const ordered_json before = calibration_->state();
  const std::string rig = calibration_->rig_toml();
  for (const char* what : {"only 2 of 9 tags were found", "broken"})
    for (const char* place : {"left", "right-again"}) {
      const ordered_json state = send(what, place);
      EXPECT_EQ(state["result"], before["result"]) << what << place;
      EXPECT_EQ(state["fit"], before["fit"]);
      EXPECT_EQ(state["next"], before["next"]);
      const size_t at = PhotoSession::place_of(place);
      const ordered_json& photo = state["photographs"][at];
      EXPECT_EQ(photo["used"], before["photographs"][at]["used"]);
      EXPECT_NE(photo["refusal"], "");
      EXPECT_NE(photo["remedy"], "");
      EXPECT_EQ(photo["refusal"].get<std::string>().find(folder_.path().string()),
                std::string::npos)
          << "the sender learns no path of the server";
    }
  EXPECT_EQ(files(), (std::set<std::string>{"left.jpg", "middle.jpg", "right.jpg"}));
  EXPECT_EQ(calibration_->rig_toml(), rig);
  const ordered_json after = send("good", "left");
  EXPECT_EQ(after["photographs"][1]["refusal"], "");
  EXPECT_EQ(basis(after), 3);
}

TEST_F(PhotoCalibrationTest, KeepsAPhotographWithWhichTheErrorIsTooLarge) {
  calibration_->begin();
  for (int n = 0; n < 3; ++n) (void)send("good");
  ordered_json state = send("worse");
  EXPECT_EQ(basis(state), 1) << "the first one alone, for its place";
  EXPECT_EQ(state["fit"]["progress_lenses"], ordered_json({0.08, 0.03, 0.09}));
  EXPECT_EQ(state["next"], "left-again");
  EXPECT_EQ(files().size(), 4U);
  calibration_->remove("right-again");
  EXPECT_EQ(basis(calibration_->state()), 3);
}

TEST_F(PhotoCalibrationTest, RemovingFitsTheOthersAgain) {
  calibration_->begin();
  for (int n = 0; n < 3; ++n) (void)send("good");
  EXPECT_THROW(calibration_->remove("right-again"), HttpError);
  EXPECT_THROW(calibration_->remove("../rig"), HttpError);
  calibration_->remove("middle");
  ordered_json state = calibration_->state();
  EXPECT_EQ(state["stage"], "found");
  EXPECT_EQ(basis(state), 1) << "two state too large an error: the left one alone";
  EXPECT_EQ(state["fit"]["stated_lenses"], 0.08);
  EXPECT_EQ(state["next"], "middle");
  calibration_->remove("left");
  state = calibration_->state();
  EXPECT_EQ(state["fit"]["stated_lenses"], nullptr);
  EXPECT_EQ(basis(state), 1);
  calibration_->remove("right");
  EXPECT_EQ(calibration_->state()["stage"], "chart");
  EXPECT_THROW((void)calibration_->rig_toml(), HttpError);
  EXPECT_EQ(files(), std::set<std::string>());
}

TEST_F(PhotoCalibrationTest, BeginDiscardAndAnInterruptedUploadLeaveNoPhotograph) {
  calibration_->begin();
  (void)send("good");
  calibration_->begin();
  EXPECT_EQ(files(), std::set<std::string>());
  EXPECT_EQ(calibration_->state()["next"], "middle");
  (void)send("good");
  calibration_->discard();
  EXPECT_EQ(files(), std::set<std::string>());
  calibration_->begin();
  {
    const auto sink = calibration_->photograph("left");
    EXPECT_THROW((void)calibration_->photograph({}), HttpError) << "one at a time";
  }
  EXPECT_TRUE(std::filesystem::is_empty(folder_ / "calibration/incoming"));
}

}  // namespace
}  // namespace lenticule::web
