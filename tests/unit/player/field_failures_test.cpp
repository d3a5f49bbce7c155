// SPDX-License-Identifier: Apache-2.0
// Tests that failures known from other players do not occur here; each test plays from a source
// through the player to the panel.
#include <gmock/gmock.h>

#include <cerrno>
#include <cmath>
#include <numeric>

#include "panel_fixture.h"
#include "player/session/panel_wait.h"
#include "player/session/play_service.h"

namespace lenticule::player {
namespace {

using display::Nanoseconds;
using display::Verdict;
using std::chrono::hours;
using std::chrono::milliseconds;
using std::chrono::seconds;
using test::EdidMaker;
using test::make_mode;
using ::testing::HasSubstr;

class FieldFailures : public test::PanelFixture {
 protected:
  /// Plays `frames` frames and expects each of them displayed, once and in order.
  void expect_all_shown(uint64_t frames = 20) {
    script.frames = frames;
    const PlayResult result = play_script();
    EXPECT_EQ(result.outcome, PlayOutcome::Finished);
    std::vector<uint64_t> all(frames);
    std::iota(all.begin(), all.end(), uint64_t{0});
    EXPECT_EQ(ids(), all);
  }
  [[nodiscard]] std::unique_ptr<display::KmsDisplay> open_with_retries() const {
    PanelWaitOptions waiting;
    waiting.kms = options;
    return PanelWait(waiting).open();
  }
  test::FakeProperty& add_enum(uint32_t object, const std::string& name, uint64_t value,
                               std::vector<std::pair<std::string, uint64_t>> enums) {
    return card.add_property(
        object,
        {.name = name, .flags = DRM_MODE_PROP_ENUM, .value = value, .enums = std::move(enums)});
  }
};

TEST_F(FieldFailures, ShowsTheFilmOnTheRigsPanelAmongSeveralMonitors) {
  card.set_edid(connector->id, EdidMaker{.manufacturer = "DEL", .serial_text = "DESK"}.bytes());
  test::FakeConnector& panel = card.add_connector(DRM_MODE_CONNECTOR_DisplayPort, 1,
                                                  make_mode(test::kWidth, test::kHeight, 60),
                                                  EdidMaker{.serial_text = "ONE"}.bytes());
  test::FakeConnector& third =
      card.add_connector(DRM_MODE_CONNECTOR_HDMIA, 2, make_mode(test::kWidth, test::kHeight, 60),
                         EdidMaker{.serial_text = "TWO"}.bytes());
  panel.possible_crtcs = third.possible_crtcs = 1;
  expect_all_shown();
  EXPECT_EQ(card.value(panel.id, "CRTC_ID"), crtc);
  EXPECT_EQ(card.value(connector->id, "CRTC_ID"), 0u);
  EXPECT_EQ(card.value(third.id, "CRTC_ID"), 0u);
}

TEST_F(FieldFailures, ReadsTheEdidAgainUntilItIsComplete) {
  auto damaged = EdidMaker{.serial_text = "ONE"}.bytes();
  damaged[60] ^= 0xff;
  for (const auto& asleep : {std::vector<uint8_t>{}, damaged,
                             std::vector<uint8_t>(damaged.begin(), damaged.begin() + 40)}) {
    card.set_edid(connector->id, asleep);
    machine.at(machine.now() + milliseconds(1500),
               [this] { card.set_edid(connector->id, EdidMaker{.serial_text = "ONE"}.bytes()); });
    show = open_with_retries();
    shown.clear();
    expect_all_shown();
    show.reset();
  }
}

TEST_F(FieldFailures, PlaysOnWhenFlipEventsAreLost) {
  card.event_faults.assign(20, test::EventFault::Lose);
  expect_all_shown();
  EXPECT_EQ(show->statistics().flip_timeouts, 20u);
}

TEST_F(FieldFailures, WaitsForThePanelsModeAfterAPowerCycle) {
  const auto modes = connector->modes;
  on_shown = [&](uint64_t id) {
    if (id == 5) {  // after a power cycle the panel offers a fallback mode first
      connector->modes = {make_mode(test::kWidth / 2, test::kHeight / 2, 60)};
      connector->connected = false;
      machine.announce_hotplug();
    }
    if (id == 60) {
      connector->connected = true;
      machine.announce_hotplug();
    }
    if (id == 200) connector->modes = modes;
  };
  expect_all_shown(400);
  EXPECT_EQ(show->statistics().panel, display::PanelState::Showing);
  EXPECT_EQ(show->mode().geometry, test::kPanel);
  EXPECT_EQ(card.value(card.primary_of(crtc), "CRTC_W"), uint64_t{test::kWidth});
}

TEST_F(FieldFailures, ClearsInheritedHdrAndGammaAndRestoresThemAtTheEnd) {
  connector->type = DRM_MODE_CONNECTOR_VIRTUAL;
  card.driver = "virtio_gpu";  // known to pass frames on unchanged
  card.show_console(connector->id, crtc);
  const uint32_t lut = card.add_blob({1, 2, 3});
  for (const char* name : {"GAMMA_LUT", "DEGAMMA_LUT", "CTM"})
    card.object(crtc).find(name)->value = lut;
  card.add_property(
      connector->id,
      {.name = "HDR_OUTPUT_METADATA", .flags = DRM_MODE_PROP_BLOB, .value = card.add_blob({9, 9})});
  add_enum(connector->id, "Colorspace", 9, {{"Default", 0}, {"BT2020_RGB", 9}});
  expect_all_shown();
  EXPECT_EQ(show->exactness().verdict, Verdict::Yes);
  for (const char* name : {"GAMMA_LUT", "DEGAMMA_LUT", "CTM"})
    EXPECT_EQ(card.value(crtc, name), 0u) << name;
  EXPECT_EQ(card.value(connector->id, "HDR_OUTPUT_METADATA"), 0u);
  EXPECT_EQ(card.value(connector->id, "Colorspace"), 0u);
  show.reset();
  EXPECT_NE(card.value(crtc, "GAMMA_LUT"), 0u) << "others want theirs back";
  EXPECT_EQ(card.value(connector->id, "Colorspace"), 9u);
}

TEST_F(FieldFailures, SetsTheLinkToFullRange) {
  add_enum(connector->id, "Broadcast RGB", 0,
           {{"Automatic", 0}, {"Full", 1}, {"Limited 16:235", 2}});
  expect_all_shown();
  EXPECT_EQ(card.value(connector->id, "Broadcast RGB"), 1u);
  EXPECT_NE(show->exactness().verdict, Verdict::No);
}

TEST_F(FieldFailures, RefusesOrReportsALimitedRangeThatCannotBeChanged) {
  add_enum(connector->id, "Broadcast RGB", 2, {{"Full", 1}, {"Limited 16:235", 2}}).ignores_writes =
      true;
  EXPECT_THROW(open(), Error) << "refused unless told otherwise";
  options.allow_inexact = true;
  expect_all_shown();
  EXPECT_EQ(show->exactness().verdict, Verdict::No);
  EXPECT_THAT(show->exactness().summary(), HasSubstr("Broadcast RGB"));
  EXPECT_FALSE(show->exactness().remedies.empty());
}

TEST_F(FieldFailures, ReportsUnknownExactnessForAnHdmiPanelThatAcceptsYcbcr) {
  card.set_edid(connector->id, EdidMaker{.serial_text = "ONE", .ycbcr = true}.bytes());
  expect_all_shown();
  EXPECT_EQ(show->exactness().verdict, Verdict::Unknown);
  EXPECT_THAT(show->exactness().summary(), HasSubstr("YCbCr"));
}

TEST_F(FieldFailures, ResetsAScaledPlaneLeftByAnotherProgram) {
  card.show_console(connector->id, crtc);
  test::FakeObject& plane = card.object(card.primary_of(crtc));
  plane.find("SRC_W")->value = uint64_t{test::kWidth / 2} << 16;  // left by the program before
  plane.find("CRTC_X")->value = 3;
  on_shown = [&](uint64_t) {
    EXPECT_EQ(plane.value("SRC_W"), uint64_t{test::kWidth} << 16);
    EXPECT_EQ(plane.value("SRC_H"), uint64_t{test::kHeight} << 16);
    EXPECT_EQ(plane.value("CRTC_W"), uint64_t{test::kWidth});
    EXPECT_EQ(plane.value("CRTC_H"), uint64_t{test::kHeight});
    EXPECT_EQ(plane.value("CRTC_X") + plane.value("CRTC_Y"), 0u);
    EXPECT_EQ(plane.value("SRC_X") + plane.value("SRC_Y"), 0u);
  };
  expect_all_shown();
}

TEST_F(FieldFailures, RefusesAPanelLargerThanTheFilm) {
  connector->modes = {make_mode(2 * test::kWidth, 2 * test::kHeight, 60)};
  EXPECT_THROW(open(), Error);
  EXPECT_EQ(card.modesets, 0);
}

class Uptime : public FieldFailures, public ::testing::WithParamInterface<int> {};

TEST_P(Uptime, CountsVblanksAndMeasuresRefreshAsAfterAFreshStart) {
  machine.advance_to(hours(24 * GetParam()));
  playing.content = frames::Rate{24, 1};
  script.frames = 24;
  const PlayResult result = play_script();
  EXPECT_EQ(ids().size(), 24u);
  EXPECT_EQ(result.report.pace.vblanks, static_cast<uint64_t>(result.report.refresh.hertz()))
      << "a second, as after a fresh start";
  EXPECT_EQ(result.report.pace.missed, 0u);
  EXPECT_TRUE(std::isfinite(result.report.refresh_measured_hz));
  EXPECT_NEAR(result.report.refresh_measured_hz, 59.9, 0.5);
}

INSTANTIATE_TEST_SUITE_P(Days, Uptime, ::testing::Values(1, 30, 400, 4000));

TEST_F(FieldFailures, LoopsWithoutAGapAndShowsTheLastFrameInFull) {
  script.frames = 5;
  playing.loops = 200;
  playing.content = frames::Rate{30, 1};
  uint64_t loop_points = 0;
  Nanoseconds last{0};
  on_shown = [&](uint64_t id) {
    const Nanoseconds now = machine.now();
    if (id > 0) {
      EXPECT_EQ((now - last + card.period / 2) / card.period, 2) << "frame " << id;
    }
    loop_points += id % 5 == 0 ? 1 : 0;
    last = now;
  };
  const PlayResult result = play_script();
  EXPECT_EQ(loop_points, 200u);
  EXPECT_EQ(result.report.pace.shown, 1000u);
  EXPECT_EQ(result.report.pace.vblanks, 2000u) << "the last frame has its time, too";
}

TEST_F(FieldFailures, KeepsTheLastFrameWhenTheRendererFreezes) {
  script.frames = 10;
  script.ready_at = [](uint64_t n) { return n < 6 ? seconds(0) : hours(100'000); };
  playing.stall_timeout = seconds(30);
  EXPECT_EQ(play_script().outcome, PlayOutcome::SourceStalled);
  EXPECT_EQ(card.displayed(crtc), test::words_of(test::numbered_frame(test::kPanel, 5)))
      << "the last whole frame stays";
}

TEST_F(FieldFailures, StopsWatchdogPingsWhenNoFrameIsShown) {
  open();
  Watchdog watchdog;
  PlayReport report;
  const auto should_ping = [&] {
    const display::KmsStatistics now = show->statistics();
    return watchdog.should_ping(progress_sample(report, &now));
  };
  flip(1);
  EXPECT_TRUE(should_ping());
  EXPECT_FALSE(should_ping()) << "nothing was shown, and the display was not even asked";
  card.flip_faults = {{.error = EBUSY, .until = machine.now() + hours(1)}};
  card.commit_faults = card.flip_faults;
  EXPECT_EQ(submit(2), test::SubmitStatus::Accepted);
  EXPECT_EQ(wait(seconds(20)).kind, test::EventKind::Timeout);
  report.wake.count += 100;  // the thread runs, but displays no picture
  EXPECT_FALSE(should_ping());
}

TEST_F(FieldFailures, ShowsEverySubpixelUnchanged) {
  open();
  display::ScanoutBuffer* buffer = show->acquire();
  ASSERT_NE(buffer, nullptr);
  frames::WovenFrame frame(
      test::kPanel);  // adjacent subpixels with the largest possible difference
  for (size_t i = 0; i < frame.bytes().size(); ++i)
    frame.bytes()[i] = (i + i / frame.geometry().row_bytes()) % 2 == 0 ? 0 : 255;
  buffer->fill(frame.view());
  ASSERT_EQ(show->submit(buffer, 1), test::SubmitStatus::Accepted);
  ASSERT_EQ(wait().kind, test::EventKind::Flip);
  EXPECT_EQ(card.displayed(crtc), test::words_of(frame));
}

TEST_F(FieldFailures, RefusesAFilmWovenForAnotherPanel) {
  options.output.identity.serial = "ANOTHER";
  EXPECT_THROW(open(), Error);
  options.output.identity.serial = "ONE";
  script.geometry.width = test::kWidth + 1;
  EXPECT_THROW((void)play_script(), Error);
  EXPECT_TRUE(shown.empty());
}

TEST_F(FieldFailures, RecoversWithoutRestartAfterCableIsReplugged) {
  PanelWaitOptions waiting;
  waiting.kms = options;
  PanelWait panel(waiting);
  show = panel.open();
  playing.reconnect = [&](const LostDisplay& lost) { return panel.reconnect(*show, lost); };
  on_shown = [this](uint64_t id) {
    if (id != 9) return;
    card.unplug();
    machine.at(machine.now() + seconds(30), [this] { card.gone = false; });
  };
  script.frames = 20;
  const PlayResult result = play_script();
  EXPECT_EQ(result.outcome, PlayOutcome::Finished);
  EXPECT_EQ(result.report.display_returns, 1u);
  EXPECT_EQ(ids().back(), 19u);
}

}  // namespace
}  // namespace lenticule::player
