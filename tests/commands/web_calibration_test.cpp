// SPDX-License-Identifier: Apache-2.0
// Tests the calibration with a phone, from the address to the saved rig: `lenticule web` beside a
// player on the virtual display. The simulated bench is the lens sheet and the phone's camera.
#include <gtest/gtest.h>

#include <cmath>
#include <fstream>

#include "apps/lenticule-web/link/control_link.h"
#include "frames/image_io.h"
#include "optics/rig_file.h"
#include "tests/commands/web_stage.h"
#include "tests/support/phone_camera.h"

namespace lenticule::test {
namespace {

using nlohmann::ordered_json;

class PhoneCalibration : public WebTest {
 protected:
  void SetUp() override {
    WebTest::SetUp();
    optics::save_rig(camera_.start(), path("rig.toml"));
    write_picture("still.png", 40,
                  {.width = PhoneCamera::kPanelWidth, .height = PhoneCamera::kPanelHeight});
    start({LENTICULE_PROGRAM, "play", path("still.png"), "--rig", path("rig.toml"), "--display",
           "virtual:3840x2160@60", "--control", path("c.sock"), "--loop", "forever", "--slots",
           "6"});
    ASSERT_TRUE(comes_true([&] { return frames_shown() > 0; }));
    start_web();
    connect();
    open_address();
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
    web::LinkConnection connection(path("c.sock"), std::chrono::seconds(5));
    connection.send(request);
    return connection.receive(kPlayerTimeout).value_or(ordered_json::object());
  }
  [[nodiscard]] std::string bytes_of(const std::string& name) const {
    std::ifstream file(path(name), std::ios::binary);
    return {std::istreambuf_iterator<char>(file), {}};
  }

  /// Photographs what the panel shows, and returns the bytes of the picture file.
  [[nodiscard]] std::string photographed_panel() {
    EXPECT_EQ(ctl({"snapshot", path("panel.png")}).exit_code, 0);
    frames::write_woven(camera_.photograph(frames::read_woven(path("panel.png"))).view(),
                        path("photo.png"));
    return bytes_of("photo.png");
  }

  PhoneCamera camera_;
  std::string cookie_;
};

TEST_F(PhoneCalibration, LeadsFromTheAddressToASavedRig) {
  const HttpAnswer page = phone("GET", "/calibrate");
  EXPECT_EQ(page.status, 200);
  EXPECT_NE(page.body.find(R"(accept="image/*" capture="environment")"), std::string::npos);
  EXPECT_EQ(calibration("GET", "")["stage"], "idle");
  ASSERT_EQ(calibration("POST", "/begin")["stage"], "chart");
  ASSERT_TRUE(comes_true([&] { return says_about("on_glass", "chart.png"); }));

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
  EXPECT_TRUE(comes_true([&] { return says_about("on_glass", "still.png"); })) << status().dump();
}

TEST_F(PhoneCalibration, RefusesWithTheWordsOfTheCommandAndSavesNothing) {
  const std::string old_rig = bytes_of("rig.toml");
  ASSERT_EQ(calibration("POST", "/begin")["stage"], "chart");
  const ordered_json garbage = calibration("PUT", "/photograph", "no picture");
  EXPECT_EQ(garbage["stage"], "refused");
  EXPECT_NE(garbage["message"].get<std::string>().find("photo.jpg"), std::string::npos) << garbage;
  const ordered_json dark = calibration("PUT", "/photograph", bytes_of("still.png"));
  EXPECT_EQ(dark["stage"], "refused") << dark;
  EXPECT_FALSE(dark["result"]["reasons"].empty()) << dark;
  EXPECT_EQ(phone("POST", "/api/v1/calibration/keep").status, 409);
  EXPECT_EQ(phone("GET", "/api/v1/calibration/rig.toml").status, 404);
  EXPECT_EQ(calibration("POST", "/discard")["stage"], "idle");
  EXPECT_TRUE(comes_true([&] { return says_about("on_glass", "still.png"); })) << status().dump();
  EXPECT_EQ(bytes_of("rig.toml"), old_rig);
  EXPECT_FALSE(std::filesystem::exists(path("rig.1.toml")));
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
