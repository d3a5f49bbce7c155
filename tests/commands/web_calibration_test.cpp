// SPDX-License-Identifier: Apache-2.0
// Tests the calibration with a phone, from the address to the saved rig: `lenticule web` beside a
// player on the virtual display. The simulated bench is the lens sheet and the phone's camera.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <fstream>
#include <set>

#include "apps/lenticule-web/api/pictures.h"
#include "apps/lenticule-web/link/control_link.h"
#include "frames/image_io.h"
#include "optics/rig_file.h"
#include "tests/commands/web_stage.h"
#include "tests/support/phone_camera.h"
#include "tests/support/scratch_folder.h"
#include "tests/support/small_workshop.h"

namespace lenticule::test {
namespace {

using nlohmann::ordered_json;

class PhoneCalibration : public WebTest {
 protected:
  void SetUp() override {
    WebTest::SetUp();
    optics::save_rig(start_rig(), path("rig.toml"));
    const optics::Panel& panel = start_rig().panel;
    write_picture("still.png", 40, {.width = panel.width_px, .height = panel.height_px});
    start_player();
    start_web();
    connect();
    open_address();
  }

  /// Returns the rig that the player has before the calibration.
  [[nodiscard]] virtual const optics::Rig& start_rig() const { return camera_.start(); }
  [[nodiscard]] static std::string display(const optics::Panel& panel) {
    return "virtual:" + std::to_string(panel.width_px) + "x" + std::to_string(panel.height_px) +
           "@60";
  }
  void start_player() {
    std::vector<std::string> words = {LENTICULE_PROGRAM,
                                      "play",
                                      path("still.png"),
                                      "--rig",
                                      path("rig.toml"),
                                      "--display",
                                      display(start_rig().panel),
                                      "--control",
                                      path("c.sock"),
                                      "--loop",
                                      "forever",
                                      "--slots",
                                      "6"};
    if (uses_store_) words.insert(words.end(), {"--rig-store", path("kept.toml")});
    start(words);
    ASSERT_TRUE(comes_true([&] { return frames_shown() > 0; }));
  }
  /// Shows the chart, sends its photograph and keeps the rig; returns the last answer.
  ordered_json calibrate_and_keep() {
    EXPECT_EQ(calibration("POST", "/begin")["stage"], "chart");
    EXPECT_TRUE(comes_true([&] { return says_about("displayed", "chart.png"); }));
    const std::string distance = std::to_string(std::lround(camera_.distance_mm()));
    EXPECT_EQ(calibration("PUT", "/photograph?distance=" + distance, photographed_panel())["stage"],
              "found");
    return calibration("POST", "/keep");
  }

  /// Opens the address that the owner passes on, as a phone does.
  void open_address() {
    const std::string printed = run({"web", "address", "--state", path("state")}).out;
    const size_t begin = printed.find("/enter");
    ASSERT_NE(begin, std::string::npos) << printed;
    const HttpAnswer entered =
        HttpClient(port_).ask("GET", printed.substr(begin, printed.find('\n') - begin));
    ASSERT_EQ(entered.status, 200);
    cookie_ = entered.header("Set-Cookie");
    cookie_ = cookie_.substr(0, cookie_.find(';'));
  }
  [[nodiscard]] HttpAnswer phone(const std::string& method, const std::string& address,
                                 const std::string& body = {}) const {
    return HttpClient(port_, "127.0.0.1", kPlayerTimeout)
        .ask(method, address,
             {{"Cookie", cookie_}, {"Origin", "http://panel:8420"}, {"Accept", "*/*"}}, body);
  }
  /// Returns the state of the calibration; checks that it has the described form.
  [[nodiscard]] ordered_json calibration(const std::string& method, const std::string& address,
                                         const std::string& body = {}) const {
    const HttpAnswer answer = phone(method, "/api/v1/calibration" + address, body);
    EXPECT_EQ(answer.status, 200) << address << answer.body;
    ordered_json state = ordered_json::parse(answer.body, nullptr, false);
    std::string wrong;
    compare(state, {{"$ref", "#/components/schemas/Calibration"}}, description(), address, wrong);
    EXPECT_EQ(wrong, "");
    return state;
  }
  [[nodiscard]] ordered_json player_answer(const ordered_json& request) const {
    JsonLineSocket connection(path("c.sock"), std::chrono::seconds(5), web::kLinkOptions);
    connection.send(request);
    return connection.receive(kPlayerTimeout).value_or(ordered_json::object());
  }
  [[nodiscard]] std::string bytes_of(const std::string& name) const {
    return read_text(path(name));
  }

  /// Returns the rig that the player uses, as the server knows it.
  [[nodiscard]] optics::Rig web_rig() const {
    web::ControlLink link(path("c.sock"));
    web::PictureMaker pictures(link);
    return optics::parse_rig(pictures.rig_toml(), "rig");
  }

  /// Photographs what the panel shows, and returns the bytes of the picture file.
  [[nodiscard]] std::string photographed_panel() {
    EXPECT_EQ(ctl({"snapshot", path("panel.png")}).exit_code, 0);
    frames::write_woven(camera_.photograph(frames::read_woven(path("panel.png"))).view(),
                        path("photo.png"));
    return bytes_of("photo.png");
  }

  /// Returns why the newest photograph from a place was refused.
  [[nodiscard]] static std::string refusal(const ordered_json& state, size_t place = 0) {
    return state["photographs"][place]["refusal"].get<std::string>();
  }

  PhoneCamera camera_;
  std::string cookie_;
  bool uses_store_ = false;
};

/// The panel is photographed from several places, by a phone in the hand.
class HandHeldCalibration : public PhoneCalibration {
 protected:
  [[nodiscard]] const optics::Rig& start_rig() const override { return phone_.start(); }
  /// Shows the chart and keeps the frame that the panel then shows.
  void begin() {
    ASSERT_EQ(calibration("POST", "/begin")["stage"], "chart");
    ASSERT_TRUE(comes_true([&] { return says_about("displayed", "chart.png"); }));
    keep_frame();
  }
  void keep_frame() {
    EXPECT_EQ(ctl({"snapshot", path("panel.png")}).exit_code, 0);
    shown_ = frames::read_woven(path("panel.png"));
  }
  [[nodiscard]] std::string photo(size_t shot, bool cut = false) const {
    phone_.photograph(shown_, shot, path("photo.jpg"), cut);
    return bytes_of("photo.jpg");
  }
  [[nodiscard]] ordered_json send(const std::string& bytes, const std::string& place = {}) const {
    return calibration("PUT", "/photograph" + (place.empty() ? place : "?place=" + place), bytes);
  }
  /// Returns the names of the photographs that the server keeps.
  [[nodiscard]] std::set<std::string> kept() const {
    std::set<std::string> names;
    for (const auto& entry :
         std::filesystem::recursive_directory_iterator(path("state") + "/calibration"))
      if (entry.path().extension() == ".jpg") names.insert(entry.path().filename());
    return names;
  }

  /// Returns the fraction of a picture's pixels that are dark in all channels.
  [[nodiscard]] double dark_share(const std::string& picture) const {
    std::ofstream(path(picture), std::ios::binary)
        << phone("GET", "/api/v1/calibration/" + picture).body;
    const frames::WovenFrame frame = frames::read_woven(path(picture));
    size_t dark = 0;
    for (size_t k = 0; k < frame.bytes().size(); k += 3)
      dark += std::ranges::max(frame.bytes().subspan(k, 3)) < 40 ? 1 : 0;
    return static_cast<double>(3 * dark) / static_cast<double>(frame.bytes().size());
  }

  HandHeldPhone phone_;
  frames::WovenFrame shown_;
};

/// The player of a kiosk: its rig belongs to the administrator, and it saves into a copy.
class KioskCalibration : public PhoneCalibration {
 protected:
  void SetUp() override {
    uses_store_ = true;
    PhoneCalibration::SetUp();
  }
};

TEST_F(PhoneCalibration, LeadsFromTheAddressToASavedRig) {
  const HttpAnswer page = phone("GET", "/calibrate");
  EXPECT_EQ(page.status, 200);
  EXPECT_NE(page.body.find(R"(accept="image/*" capture="environment")"), std::string::npos);
  EXPECT_EQ(calibration("GET", "")["stage"], "idle");
  ASSERT_EQ(calibration("POST", "/begin")["stage"], "chart");
  ASSERT_TRUE(comes_true([&] { return says_about("displayed", "chart.png"); }));

  const std::string old_rig = bytes_of("rig.toml");
  const std::string distance = std::to_string(std::lround(camera_.distance_mm()));
  const ordered_json found =
      calibration("PUT", "/photograph?distance=" + distance, photographed_panel());
  ASSERT_EQ(found["stage"], "found") << found;
  EXPECT_EQ(found["result"]["verdict"], "effective");
  EXPECT_GT(found["result"]["residual_lenses"]["values"].size(), 20u);
  const HttpAnswer before = phone("GET", "/api/v1/calibration/before.jpg");
  const HttpAnswer after = phone("GET", "/api/v1/calibration/after.jpg");
  EXPECT_EQ(before.header("Content-Type"), "image/jpeg") << before.body;
  EXPECT_EQ(after.header("Content-Type"), "image/jpeg") << after.body;
  EXPECT_NE(before.body, after.body);
  EXPECT_EQ(bytes_of("rig.toml"), old_rig) << "nothing is saved before the rig is kept";

  EXPECT_EQ(calibration("POST", "/keep")["stage"], "kept");
  EXPECT_EQ(bytes_of("rig.1.toml"), old_rig);
  const optics::Rig rig = optics::load_rig(path("rig.toml"));
  EXPECT_GT(camera_.worst_phase(camera_.start()), 0.2) << "the start is wrong";
  EXPECT_LT(camera_.worst_phase(rig), 0.05);
  EXPECT_TRUE(comes_true([&] { return says_about("displayed", "still.png"); })) << status().dump();
}

TEST_F(KioskCalibration, KeepsTheRigForGoodAndLeadsBackToAnyOther) {
  EXPECT_EQ(calibration("GET", "")["history"].size(), 0u);
  const std::string given = bytes_of("rig.toml");
  const optics::Rig start = optics::load_rig(path("rig.toml"));
  const ordered_json kept = calibrate_and_keep();
  EXPECT_EQ(kept["stage"], "kept") << kept;
  EXPECT_EQ(kept["history"].size(), 2u) << kept;
  EXPECT_EQ(kept["history"][0]["who"], "first");
  EXPECT_EQ(bytes_of("rig.toml"), given) << "the file of the administrator stays";
  const optics::Rig found = optics::load_rig(path("kept.toml"));
  EXPECT_LT(camera_.worst_phase(found), 0.05);

  (void)quit();
  start_player();
  connect();
  EXPECT_EQ(web_rig(), found) << "also after a restart";

  EXPECT_EQ(calibration("POST", "/restore", R"({"number": 1})")["stage"], "kept");
  EXPECT_EQ(optics::load_rig(path("kept.toml")), start);
  EXPECT_EQ(calibration("POST", "/restore", R"({"number": 2})")["history"].size(), 4u);
  EXPECT_EQ(optics::load_rig(path("kept.toml")), found);
  EXPECT_EQ(phone("POST", "/api/v1/calibration/restore", R"({"number": 9})").status, 404);

  optics::Rig edited = start;
  edited.sheet.offset = edited.sheet.offset + Lenses(0.25);
  optics::save_rig(edited, path("rig.toml"));
  EXPECT_TRUE(comes_true([&] { return web_rig() == edited; }))
      << "the administrator has the last word";
}

TEST_F(PhoneCalibration, RefusesWithTheWordsOfTheCommandAndSavesNothing) {
  const std::string old_rig = bytes_of("rig.toml");
  ASSERT_EQ(calibration("POST", "/begin")["stage"], "chart");
  const ordered_json garbage = calibration("PUT", "/photograph", "no picture");
  EXPECT_EQ(garbage["stage"], "refused");
  EXPECT_NE(refusal(garbage).find("middle.jpg"), std::string::npos) << garbage;
  EXPECT_EQ(refusal(garbage).find(path("state")), std::string::npos) << "no folder of the server";
  const ordered_json dark = calibration("PUT", "/photograph", bytes_of("still.png"));
  EXPECT_EQ(dark["stage"], "refused") << dark;
  EXPECT_NE(refusal(dark).find("tags were found"), std::string::npos) << dark;
  EXPECT_NE(dark["photographs"][0]["remedy"], "");
  EXPECT_EQ(phone("POST", "/api/v1/calibration/keep").status, 409);
  EXPECT_EQ(phone("GET", "/api/v1/calibration/rig.toml").status, 404);
  EXPECT_EQ(calibration("POST", "/discard")["stage"], "idle");
  EXPECT_TRUE(comes_true([&] { return says_about("displayed", "still.png"); })) << status().dump();
  EXPECT_EQ(bytes_of("rig.toml"), old_rig);
  EXPECT_FALSE(std::filesystem::exists(path("rig.1.toml")));
}

/// Returns the beginning of a JPEG file of that size, with an EXIF segment, and no picture.
std::string jpeg_head(uint16_t width, uint16_t height, const std::string& exif) {
  const auto two = [](size_t value) {
    return std::string{static_cast<char>(value >> 8), static_cast<char>(value & 0xff)};
  };
  const std::string tables = "Exif" + std::string(2, '\0') + exif;
  return "\xff\xd8\xff\xe1" + two(tables.size() + 2) + tables + "\xff\xc0" + two(17) + "\x08" +
         two(height) + two(width) + "\x03\x01\x22" + std::string(1, '\0') +
         "\x02\x11\x01\x03\x11\x01";
}

// They reach the confined decoder, which may fail in any way; the server and the player go on.
TEST_F(PhoneCalibration, HostilePhotographsAreRefused) {
  const std::string old_rig = bytes_of("rig.toml");
  ASSERT_EQ(calibration("POST", "/begin")["stage"], "chart");
  const std::string photo = photographed_panel();
  const std::string endless_exif = "II*" + std::string("\0\x08\0\0\0\xff\xff", 7) +
                                   std::string(20000, '\x7f') + std::string(4, '\x08');
  std::string broken = photo;
  for (size_t k = 200; k < broken.size(); k += 97) broken[k] = static_cast<char>(~broken[k]);
  const std::map<std::string, std::string> hostile = {
      {"a bomb of 65500 x 65500 pixels", jpeg_head(65500, 65500, "II*")},
      {"a bomb of 16000 x 16000 pixels", jpeg_head(16000, 16000, "II*") + std::string(100000, 'x')},
      {"an endless EXIF table", jpeg_head(640, 480, endless_exif)},
      {"half a picture", photo.substr(0, photo.size() / 2)},
      {"changed bytes", broken},
      {"a script", "#!/bin/sh\nkill -9 1\n"},
      {"zeros", std::string(1 << 20, '\0')}};
  for (const auto& [what, bytes] : hostile) {
    const ordered_json answer = calibration("PUT", "/photograph", bytes);
    EXPECT_EQ(answer["stage"], "refused") << what << answer;
    EXPECT_NE(refusal(answer), "") << what;
  }
  HttpClient large(port_);
  large.say("PUT /api/v1/calibration/photograph HTTP/1.1\r\nHost: panel:8420\r\nCookie: " +
            cookie_ + "\r\nOrigin: http://panel:8420\r\nContent-Length: 209715200\r\n\r\n");
  EXPECT_EQ(large.answer().status, 413) << "200 MB are refused before they are sent";
  EXPECT_EQ(bytes_of("rig.toml"), old_rig);
  EXPECT_TRUE(film_continues());
  EXPECT_EQ(calibration("PUT", "/photograph", photo)["stage"], "found") << "and then a good one";
}

TEST_F(HandHeldCalibration, SeveralPhotographsGiveARigForEveryEye) {
  begin();
  ordered_json now = send(photo(0));
  ASSERT_EQ(now["stage"], "found") << now;
  EXPECT_EQ(now["result"]["photographs"], 1);
  EXPECT_EQ(now["fit"]["stated_lenses"], nullptr) << "nothing is known about other eyes";
  EXPECT_EQ(now["next"], "left");

  now = send(photo(1));
  EXPECT_EQ(now["stage"], "found") << now;
  EXPECT_EQ(now["next"], "right") << "two state a larger error than is wanted";
  const double two = now["fit"]["stated_lenses"];
  EXPECT_GT(two, 0.02);
  EXPECT_EQ(now["result"]["photographs"], two <= 0.05 ? 2 : 1) << two;
  now = send(photo(2));
  ASSERT_EQ(now["stage"], "found") << now;
  EXPECT_EQ(now["result"]["photographs"], 3);
  const double three = now["fit"]["stated_lenses"];
  EXPECT_LT(three, two);
  EXPECT_LE(three, 0.05);
  for (const ordered_json& one : now["photographs"]) EXPECT_EQ(one["note"], "") << one;

  EXPECT_GT(dark_share("before.jpg"), 0.15) << "the start is off by lenses";
  EXPECT_LT(dark_share("after.jpg"), 0.02);
  EXPECT_EQ(kept(), (std::set<std::string>{"left.jpg", "middle.jpg", "right.jpg"}));
  EXPECT_EQ(calibration("POST", "/keep")["history"][0]["what"], "3 photographs");
  EXPECT_EQ(kept(), std::set<std::string>());
  const double error = phone_.error_of(optics::load_rig(path("rig.toml")));
  EXPECT_GT(phone_.error_of(start_rig()), 0.2) << "the start is wrong";
  EXPECT_LT(error, three) << "the stated error holds for every eye";
}

// The first one is refused alone, as its distance is wrong; two state too large an error, and three
// contradict each other, as one was zoomed.
TEST_F(HandHeldCalibration, PhotographsThatAreFineTogetherOnlyGiveARigInSpiteOfOneThatSpoilsIt) {
  begin();
  ordered_json now = send(photo(1), "left&distance=300");
  EXPECT_EQ(now["stage"], "refused") << now;
  EXPECT_EQ(now["photographs"][1]["used"], true) << now;
  EXPECT_EQ(now["next"], "middle");
  now = send(photo(0));
  ASSERT_EQ(now["fit"]["progress_lenses"].size(), 1U) << now;
  EXPECT_GT(now["fit"]["stated_lenses"], 0.02);
  EXPECT_EQ(now["next"], "right");

  phone_.photograph_zoomed(shown_, 2, path("zoomed.jpg"));
  now = send(bytes_of("zoomed.jpg"));
  EXPECT_EQ(now["photographs"][2]["refusal"], "") << now;
  EXPECT_EQ(now["fit"]["stated_lenses"], nullptr) << now;
  EXPECT_NE(now["result"]["photographs"], 3) << now;
  EXPECT_EQ(now["next"], "right-again");
  now = send(photo(3));
  EXPECT_EQ(now["stage"], "found") << now;
  EXPECT_EQ(now["photographs"][2]["used"], false);
  EXPECT_NE(now["photographs"][2]["note"].get<std::string>().find("set aside: "), std::string::npos)
      << now;
  EXPECT_EQ(now["result"]["photographs"], 3) << now;
  ASSERT_EQ(now["fit"]["progress_lenses"].size(), 2U) << now;
  EXPECT_LT(now["fit"]["progress_lenses"][1], now["fit"]["progress_lenses"][0]);
  EXPECT_EQ(now["next"], "left-again") << "a fourth one checks whether anything moved";
  EXPECT_EQ(kept().size(), 4U) << "also the one that is set aside";

  const double stated = now["fit"]["stated_lenses"];
  EXPECT_EQ(calibration("POST", "/keep")["stage"], "kept");
  EXPECT_LT(phone_.error_of(optics::load_rig(path("rig.toml"))), stated);
}

TEST_F(HandHeldCalibration, ARefusedPhotographTakesNothingFromTheOthers) {
  begin();
  EXPECT_EQ(send(photo(0, true))["stage"], "refused") << "the first one is cut";
  ASSERT_EQ(send(photo(0))["stage"], "found");
  const std::string first = calibration("GET", "").dump();
  const std::string rig = phone("GET", "/api/v1/calibration/rig.toml").body;
  for (const std::string& bytes : {std::string("no picture"), bytes_of("still.png")}) {
    const ordered_json now = send(bytes, "left");
    EXPECT_EQ(now["stage"], "found") << now;
    EXPECT_NE(refusal(now, 1), "");
    EXPECT_FALSE(now["photographs"][1]["used"]);
    EXPECT_EQ(now["next"], "left");
  }
  EXPECT_EQ(phone("GET", "/api/v1/calibration/rig.toml").body, rig);
  EXPECT_EQ(kept(), std::set<std::string>{"middle.jpg"});

  ordered_json now = send(photo(1), "left");
  EXPECT_EQ(refusal(now, 1), "");
  EXPECT_TRUE(now["photographs"][1]["used"]);
  EXPECT_NE(refusal(send("no picture", "left"), 1), "");
  now = calibration("GET", "");
  EXPECT_TRUE(now["photographs"][1]["used"]) << "the good one stays";
  // Its file is whole: a fit without the first photograph uses it.
  EXPECT_EQ(phone("DELETE", "/api/v1/calibration/photograph?place=right").status, 404);
  now = calibration("DELETE", "/photograph?place=middle");
  EXPECT_EQ(now["stage"], "found") << now;
  EXPECT_EQ(now["fit"]["photographs"], 1);
  EXPECT_EQ(now["next"], "middle");
  EXPECT_EQ(kept(), std::set<std::string>{"left.jpg"});
  EXPECT_NE(phone("GET", "/api/v1/calibration/rig.toml").body, rig);
  EXPECT_EQ(calibration("DELETE", "/photograph?place=left")["stage"], "chart");
  EXPECT_EQ(phone("GET", "/api/v1/calibration/rig.toml").status, 404);
  EXPECT_EQ(phone("PUT", "/api/v1/calibration/photograph?place=../rig", "x").status, 400);
}

TEST_F(HandHeldCalibration, AStartThatIsFarOffChangesTheChart) {
  optics::Rig far = start_rig();
  far.sheet.pitch.value *= 1.02;
  optics::save_rig(far, path("rig.toml"));
  ASSERT_TRUE(comes_true([&] { return web_rig() == far; }));
  begin();
  const std::string chart = bytes_of("state/calibration/chart.png");
  ordered_json now = send(photo(0));
  EXPECT_EQ(now["stage"], "found") << "the rig is right for the place of the camera";
  EXPECT_NE(now["message"].get<std::string>().find("chart was drawn again"), std::string::npos);
  EXPECT_NE(bytes_of("state/calibration/chart.png"), chart);
  EXPECT_EQ(now["next"], "middle");
  EXPECT_EQ(kept(), std::set<std::string>());
  const std::vector<uint8_t> old(shown_.bytes().begin(), shown_.bytes().end());
  EXPECT_TRUE(comes_true([&] {
    keep_frame();
    return !std::ranges::equal(shown_.bytes(), old);
  }));
  now = send(photo(0));
  EXPECT_EQ(now["next"], "left") << now;
  EXPECT_EQ(calibration("POST", "/keep")["stage"], "kept");
  EXPECT_EQ(optics::load_rig(path("rig.1.toml")), far) << "the rig before is that of the player";
}

// The tag of the first file says that the picture is upside down. Turned upright, it would show the
// axis of the camera at another place than the other files do.
TEST_F(HandHeldCalibration, PhotographsAreTheSensorsPicturesWhateverTheTagOfTheFileSays) {
  begin();
  std::vector<std::string> words = {"calibrate", "photos",           "--rig",  path("rig.toml"),
                                    "-o",        path("found.toml"), "--json", "--largest-error",
                                    "0.05"};
  for (size_t shot = 0; shot < 3; ++shot) {
    words.push_back(path(std::to_string(shot) + ".jpg"));
    phone_.photograph(shown_, shot, words.back());
  }
  const ProcessResult result = run(words, {.timeout = std::chrono::seconds(300)});
  EXPECT_EQ(result.exit_code, 0) << result.err << result.out;
  const ordered_json fit = ordered_json::parse(result.out, nullptr, false);
  const double stated = fit["drift"]["worst_lenses"].get<double>();
  EXPECT_EQ(fit["verdict"], stated > 0.02 ? "effective" : "intrinsic");
  ASSERT_EQ(fit["photographs"].size(), 3U);
  for (size_t shot = 0; shot < 3; ++shot) {
    const ordered_json& photo = fit["photographs"][shot];
    EXPECT_EQ(photo["name"], std::to_string(shot) + ".jpg");
    EXPECT_EQ(photo["used"], true) << photo;
    EXPECT_NEAR(photo["eye_mm"][0].get<double>(), phone_.shot(shot).eye_mm.x, 6.0);
    const double off = photo["roll_degrees"].get<double>() - phone_.shot(shot).roll_degrees;
    EXPECT_NEAR(std::remainder(off, 360.0), 0.0, 10.0) << "not upside down" << photo;
  }
}

TEST_F(PhoneCalibration, ARigOfAnotherPanelIsNotSaved) {
  const std::string old_rig = bytes_of("rig.toml");
  optics::Rig other = camera_.start();
  other.panel.width_px -= 2;
  EXPECT_EQ(player_answer({{"do", "rig"}, {"toml", optics::rig_to_toml(other)}})["ok"], false);
  EXPECT_EQ(player_answer({{"do", "rig"}, {"toml", "no rig"}})["ok"], false);
  EXPECT_EQ(bytes_of("rig.toml"), old_rig);
}

}  // namespace
}  // namespace lenticule::test
