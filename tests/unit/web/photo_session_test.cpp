// SPDX-License-Identifier: Apache-2.0
// Tests which photographs of a calibration are used, and which one is asked for next.
#include "apps/lenticule-web/api/photo_session.h"

#include <gtest/gtest.h>

#include "apps/lenticule-web/http/message.h"

namespace lenticule::web {
namespace {

using nlohmann::ordered_json;

constexpr size_t kMiddle = 0, kLeft = 1, kRight = 2, kRightAgain = 3, kLeftAgain = 4;

ordered_json photo(const char* place, double x_mm, double roll_degrees) {
  return {{"name", std::string(place) + ".jpg"},
          {"used", true},
          {"reason", ""},
          {"eye_mm", {x_mm, 10.0, 700.0}},
          {"roll_degrees", roll_degrees}};
}

ordered_json unused(const char* place, const char* reason) {
  return {{"name", std::string(place) + ".jpg"},
          {"used", false},
          {"reason", reason},
          {"eye_mm", nullptr},
          {"roll_degrees", nullptr}};
}

ordered_json report(double stated_lenses, std::initializer_list<ordered_json> photographs) {
  return {{"drift", {{"worst_lenses", stated_lenses}}},
          {"reasons", ordered_json::array()},
          {"viewpoints", {{{"name", "middle.jpg"}}}},
          {"photographs", ordered_json::array_t(photographs)}};
}

ordered_json entry(const PhotoSession& session, size_t place) {
  return session.to_json()["photographs"][place];
}

TEST(PhotoSession, AWrongPlaceOrTurnIsNotedAndAskedForAgainAtTheEnd) {
  PhotoSession session;
  for (size_t place = 0; place < kPhotoPlaces.size(); ++place) session.accept(place);
  // Phones store portraits turned by 90 degrees to either side: the two differ by half a turn.
  session.take_report(report(0.03, {photo("middle", 5, -90), photo("left", -350, 88),
                                    photo("right", 20, 91), photo("right-again", 350, -90)}));
  EXPECT_EQ(entry(session, kLeft)["note"], "");
  EXPECT_EQ(entry(session, kRightAgain)["note"], "");
  EXPECT_EQ(entry(session, kRight)["note"],
            "it was taken from the middle: go at least 350 mm to the right");
  EXPECT_EQ(session.next(), kRight);
  session.take_report(report(0.03, {photo("middle", 5, 180), photo("left", -350, 178),
                                    photo("right", 350, 0), photo("right-again", 350, 1)}));
  EXPECT_NE(entry(session, kLeft)["note"].get<std::string>().find("half a turn"),
            std::string::npos);
  EXPECT_EQ(entry(session, kRightAgain)["note"],
            "the phone was not upside down, as in the first one");
  EXPECT_EQ(session.next(), kLeft);
}

TEST(PhotoSession, KeepsAPhotographThatContradictsTheOthersAndAsksForItAgain) {
  ordered_json left = photo("left", -350, 2);
  left["doubt"] = "its focal length differs by 9 %";
  ordered_json both = report(0.08, {photo("middle", 5, 180), left});
  both["verdict"] = "refused";
  EXPECT_EQ(PhotoSession::refusal(both, kLeft), "");
  PhotoSession session;
  for (size_t place = 0; place < kPhotoPlaces.size(); ++place) session.accept(place);
  session.take_report(both);
  EXPECT_EQ(entry(session, kLeft)["note"],
            "the others contradict it: its focal length differs by 9 %");
  EXPECT_EQ(session.to_json()["fit"]["stated_lenses"], nullptr);
  EXPECT_EQ(session.next(), kLeft);
}

TEST(PhotoSession, NamesTheReasonOfARefusal) {
  const ordered_json good = report(0.08, {photo("middle", 5, 180), photo("left", -350, 2)});
  EXPECT_EQ(PhotoSession::refusal(good, kLeft), "");
  const ordered_json own =
      report(0.08, {photo("middle", 5, 180), unused("left", "only 2 of 9 tags were found")});
  EXPECT_EQ(PhotoSession::refusal(own, kLeft), "only 2 of 9 tags were found");
}

TEST(PhotoSession, APhotographThatIsSetAsideIsKeptAndNamedAndDoesNotCount) {
  ordered_json right = unused("right", "its focal length differs by 9 %");
  right["set_aside"] = true;
  const ordered_json found = report(0.015, {photo("middle", 5, 180), photo("left", -350, 2), right,
                                            photo("right-again", 350, 180)});
  EXPECT_EQ(PhotoSession::refusal(found, kRight), "");
  PhotoSession session;
  for (const size_t place : {kMiddle, kLeft, kRight, kRightAgain}) session.accept(place);
  session.take_report(report(0.07, {photo("middle", 5, 180), photo("left", -350, 2)}));
  session.take_report(found);
  EXPECT_EQ(entry(session, kRight)["note"], "set aside: its focal length differs by 9 %");
  EXPECT_EQ(entry(session, kRight)["used"], false);
  EXPECT_EQ(session.to_json()["fit"]["progress_lenses"], ordered_json({0.07, 0.015}));
  EXPECT_EQ(session.count(), 3U);
  EXPECT_EQ(session.next(), kLeftAgain) << "three do not show whether the sheet moved";
  session.accept(kLeftAgain);
  EXPECT_EQ(session.next(), std::nullopt);
}

TEST(PhotoSession, SaysWhatToDoBetter) {
  EXPECT_NE(PhotoSession::remedy("only 2 of 9 tags were found: the panel").find("all tags"),
            std::string::npos);
  EXPECT_NE(PhotoSession::remedy("the tags deviate by 18.8 pixels").find("main camera"),
            std::string::npos);
  EXPECT_NE(PhotoSession::remedy("92 % of the fringes are clipped: expose less").find("brightness"),
            std::string::npos);
  EXPECT_NE(PhotoSession::remedy("anything else").find("Take it again"), std::string::npos);
}

TEST(PhotoSession, ReportsOfAnyFormAreNoCrash) {
  PhotoSession session;
  session.accept(kMiddle);
  for (const char* text :
       {"{}", R"({"photographs": 1})", R"({"photographs": [1, null, {}]})", R"({"drift": 1})",
        R"({"photographs": [{"name": "middle.jpg", "eye_mm": [1, "a", {}], "used": "x"}]})",
        R"({"photographs": [{"name": 4}], "reasons": 1, "drift": {"worst_lenses": "a"}})"}) {
    const ordered_json odd = ordered_json::parse(text);
    session.take_report(odd);
    (void)PhotoSession::refusal(odd, kMiddle);
    EXPECT_EQ(session.to_json()["photographs"].size(), kPhotoPlaces.size());
  }
}

}  // namespace
}  // namespace lenticule::web
