// SPDX-License-Identifier: Apache-2.0
// Tests how `lenticule bench realtime` evaluates the courses of frames.
#include <gtest/gtest.h>

#include <filesystem>
#include <vector>

#include "apps/lenticule-bench/realtime/live_renderer.h"
#include "display/virtual/virtual_display.h"
#include "tests/support/scratch_folder.h"

namespace lenticule::bench {
namespace {

constexpr int64_t kMs = 1'000'000;

/// Returns frames of 100 ms: 2 ms of waiting, 8 of the scene, 70 of rendering, 10 for a slot, 5 of
/// copying, 5 of other work. Each began 20 ms after its instant of the scene.
std::vector<FrameRecord> frames_of(int count) {
  std::vector<FrameRecord> frames;
  for (int n = 0; n < count; ++n) {
    const int64_t start = (1000 + 100 * n) * kMs;
    frames.push_back({.number = static_cast<uint64_t>(3 * n),
                      .due_ns = start - 18 * kMs,
                      .free_ns = start,
                      .begun_ns = start + 2 * kMs,
                      .committed_ns = start + 10 * kMs,
                      .rendered_ns = start + 80 * kMs,
                      .acquired_ns = start + 90 * kMs,
                      .published_ns = start + 95 * kMs,
                      .memory_bytes = static_cast<uint64_t>(100 + n) << 20,
                      .tolerated_error = 2.0 + n,
                      .audited_rmse = 0.5});
  }
  return frames;
}

/// Each frame appears 7 ms after it was published.
std::vector<int64_t> shown_of(const std::vector<FrameRecord>& frames) {
  std::vector<int64_t> shown;
  for (const FrameRecord& frame : frames) shown.push_back(frame.published_ns + 7 * kMs);
  return shown;
}

TEST(RealtimeFigures, DivideTheLatencyIntoItsParts) {
  const std::vector<FrameRecord> frames = frames_of(5);
  const nlohmann::json figures = live_figures(frames, shown_of(frames));
  // 20 ms until the renderer began, 93 ms until the frame was published, 7 until it appeared.
  EXPECT_DOUBLE_EQ(figures.at("latency_ms").at("p50"), 120.0);
  EXPECT_DOUBLE_EQ(figures.at("latency_ms").at("max"), 120.0);
  const nlohmann::json expected = {{"begin", 20.0}, {"scene", 8.0}, {"render", 70.0},
                                   {"ring", 10.0},  {"copy", 5.0},  {"panel", 7.0}};
  for (const auto& [name, ms] : expected.items())
    EXPECT_NEAR(figures.at("latency_parts_ms").at(name).get<double>(), ms.get<double>(), 1e-9)
        << name;
}

TEST(RealtimeFigures, NameTheStageThatTakesMostOfTheRenderersTime) {
  std::vector<FrameRecord> frames = frames_of(10);
  nlohmann::json figures = live_figures(frames, shown_of(frames));
  EXPECT_EQ(figures.at("bound"), "render");
  double sum = 0.0;
  for (const auto& share : figures.at("shares")) sum += share.get<double>();
  EXPECT_NEAR(sum, 1.0, 1e-9);
  EXPECT_NEAR(figures["shares"].at("render").get<double>(), 700.0 / 995.0, 1e-9);
  EXPECT_NEAR(figures["shares"].at("other").get<double>(), 45.0 / 995.0, 1e-9);
  for (FrameRecord& frame : frames) frame.rendered_ns = frame.committed_ns;
  figures = live_figures(frames, shown_of(frames));
  EXPECT_EQ(figures.at("bound"), "ring");
  for (FrameRecord& frame : frames) frame.free_ns -= 85 * kMs;
  EXPECT_EQ(live_figures(frames, shown_of(frames)).at("bound"), "wait");
}

TEST(RealtimeFigures, LeaveOutFramesThatDidNotAppear) {
  const std::vector<FrameRecord> frames = frames_of(5);
  std::vector<int64_t> shown = shown_of(frames);
  shown.pop_back();
  shown[2] = 0;
  const nlohmann::json figures = live_figures(frames, shown);
  EXPECT_EQ(figures.at("frames_rendered"), 5);
  EXPECT_EQ(figures.at("frames_shown"), 3);
  EXPECT_DOUBLE_EQ(figures.at("latency_ms").at("mean"), 120.0);
}

TEST(RealtimePlot, StaysSmallForALongRun) {
  const std::vector<FrameRecord> frames = frames_of(18'000);  // half an hour
  nlohmann::json run = live_figures(frames, shown_of(frames));
  EXPECT_LE(run.at("course").size(), 240U);
  run.update({{"scene", "teapot"}, {"width", 48}, {"height", 32}, {"method", "adaptive 10/s"}});
  run["samples"] = {{{"at_s", 1.0}, {"mse", 0.25}}, {{"at_s", 2.0}, {"mse", 0.0}}};
  const test::ScratchFolder folder;
  const std::filesystem::path file = folder / "plot.svg";
  plot_realtime(run, file.string());
  EXPECT_LT(std::filesystem::file_size(file), 200'000U);
  const std::string text = test::read_text(file);
  for (const char* label : {"frames/s", "tolerated E", "RMSE, audit", "RMSE, measured"})
    EXPECT_NE(text.find(label), std::string::npos) << label;
}

TEST(TimedDisplay, NotesTheVblankOfEachFrame) {
  const auto panel =
      display::open_virtual_display({.geometry = {.width = 8, .height = 4},
                                     .clock = std::make_shared<display::SimulatedClock>()});
  TimedDisplay display(*panel, 3);
  const std::vector<uint8_t> pixels(8 * 4 * 3);
  const auto show = [&](uint64_t id) {
    display::ScanoutBuffer* const buffer = display.acquire();
    buffer->fill({display.mode().geometry, pixels});
    EXPECT_EQ(display.submit(buffer, id), display::SubmitStatus::Accepted);
    return display.wait_event(display.now() + std::chrono::seconds(1), -1).time.count();
  };
  const int64_t first = show(0);
  const int64_t second = show(2);
  (void)show(7);  // more frames than announced
  EXPECT_EQ(display.shown_ns(), (std::vector<int64_t>{first, 0, second}));
}

}  // namespace
}  // namespace lenticule::bench
