// SPDX-License-Identifier: Apache-2.0
// lenticule bench play measures the player's memory over many frames from a renderer process
// through a real ring, in simulated time for maximum speed, and the cost per frame of each kind of
// source.
#include <fmt/format.h>
#include <signal.h>
#include <sys/wait.h>
#include <unistd.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <cstring>
#include <filesystem>
#include <memory>
#include <vector>

#include "apps/lenticule-bench/harness/bench.h"
#include "apps/lenticule-bench/playback/vblank_budget.h"
#include "apps/lenticule-tools/offline/scratch_folder.h"
#include "base/error.h"
#include "base/print.h"
#include "display/virtual/virtual_display.h"
#include "frames/ring/ring_player.h"
#include "frames/ring/ring_renderer.h"
#include "player/playback/playback.h"
#include "player/process/interrupt.h"

namespace lenticule::bench {
namespace {

using std::chrono::milliseconds;
using std::chrono::seconds;

constexpr uint64_t kMebibyte = uint64_t{1} << 20;
constexpr uint64_t kAllowance = 64 * kMebibyte;
constexpr uint64_t kAllowedFrames = 4;

struct BenchFlags {
  uint64_t small_frames = 100'000;
  uint64_t large_frames = 300;
  int slots = 8;
  int runs = 15;
  std::string rig;
  bool json = false;
};

struct Row {
  frames::FrameGeometry geometry;
  player::PlayReport report;
  uint64_t early_bytes = 0;  ///< resident at the first report: own, ring and library pages
  uint64_t late_bytes = 0;   ///< resident at the end
  uint64_t allowed_bytes = 0;
  double seconds = 0;
};

/// Publishes frames of one changing grey until the player has all of them. Runs in the child
/// process.
[[noreturn]] void run_renderer(const std::filesystem::path& socket, uint64_t count) noexcept {
  try {
    const auto ring = frames::RingRenderer::connect(
        socket, {.name = "bench", .rig_fingerprint = {}, .rate = {}, .frame_count = count},
        seconds(10));
    for (uint64_t k = 0; k < count; ++k) {
      std::span<uint8_t> pixels;
      if (ring->acquire(k, seconds(10), pixels) != frames::RingStatus::Ok) _exit(1);
      std::memset(pixels.data(), static_cast<int>(k % 251), pixels.size());
      if (ring->publish() != frames::RingStatus::Ok) _exit(1);
    }
    ring->finish();
  } catch (...) {
    _exit(1);
  }
  _exit(0);
}

class RendererProcess {
 public:
  RendererProcess(const std::filesystem::path& socket, uint64_t count) : pid_(fork()) {
    if (pid_ < 0) throw Error(ErrorKind::Failed, "bench play: cannot start a renderer process");
    if (pid_ == 0) run_renderer(socket, count);
  }
  ~RendererProcess() {
    kill(pid_, SIGKILL);
    waitpid(pid_, nullptr, 0);
  }
  RendererProcess(const RendererProcess&) = delete;
  RendererProcess& operator=(const RendererProcess&) = delete;

 private:
  pid_t pid_;
};

Row measure(frames::FrameGeometry geometry, uint64_t count, int slots) {
  const tools::ScratchFolder folder;
  const std::filesystem::path socket = folder.ring_socket();
  // Forked before this process has threads; the child waits for the socket to appear.
  const RendererProcess renderer(socket, count);
  const auto begin = std::chrono::steady_clock::now();
  const auto ring = frames::RingPlayer::open(
      {.socket = socket, .geometry = geometry, .slots = slots, .rig_fingerprint = {}});
  const auto display = display::open_virtual_display(
      {.geometry = geometry, .clock = std::make_shared<display::SimulatedClock>()});

  Row row;
  row.geometry = geometry;
  row.allowed_bytes = static_cast<uint64_t>(slots) * geometry.frame_bytes() +
                      kAllowedFrames * geometry.frame_bytes() + kAllowance;
  const player::PlayResult result = player::play(*display, *ring,
                                                 {.prime = static_cast<uint64_t>(slots) / 2,
                                                  .filling = player::Filling::InPresenter,
                                                  .stop_fd = player::interrupt_fd(),
                                                  .on_report =
                                                      [&row](const player::PlayReport& report) {
                                                        if (row.early_bytes == 0)
                                                          row.early_bytes = report.memory.total;
                                                      },
                                                  .source_name = "ring"});
  if (result.report.pace.shown != count && !player::interrupted())
    throw Error(ErrorKind::Failed,
                fmt::format("bench play: {} of {} frames shown: {} {}", result.report.pace.shown,
                            count, outcome_name(result.outcome), result.failure));
  row.report = result.report;
  row.late_bytes = result.report.memory.total;
  if (row.early_bytes == 0) row.early_bytes = row.late_bytes;
  row.seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();
  return row;
}

nlohmann::json row_json(const Row& row) {
  return {{"width", row.geometry.width},
          {"height", row.geometry.height},
          {"frames", row.report.pace.shown},
          {"frames_per_s", static_cast<double>(row.report.pace.shown) / row.seconds},
          {"copy_us_p50", row.report.copy.p50_us},
          {"copy_us_p99", row.report.copy.p99_us},
          {"memory_early_bytes", row.early_bytes},
          {"memory_late_bytes", row.late_bytes},
          {"memory_allowed_bytes", row.allowed_bytes},
          {"own_and_ring_bytes", row.report.memory.anonymous + row.report.memory.shared},
          {"within_limit", row.late_bytes <= row.allowed_bytes}};
}

void print_row(const nlohmann::json& row) {
  const auto mebibytes = [&row](const char* key) { return row[key].get<uint64_t>() / kMebibyte; };
  print_out(
      "{:>4}x{:<4} {:>7} frames {:>7.0f}/s  copy {:>6.2f} ms  memory {:>4} -> {:>4} MiB of "
      "{:>4} allowed ({} MiB without library files)\n",
      row["width"].get<int>(), row["height"].get<int>(), row["frames"].get<uint64_t>(),
      row["frames_per_s"].get<double>(), row["copy_us_p50"].get<double>() / 1000,
      mebibytes("memory_early_bytes"), mebibytes("memory_late_bytes"),
      mebibytes("memory_allowed_bytes"), mebibytes("own_and_ring_bytes"));
}

ExitCode run_bench_play(const BenchFlags& flags) {
  nlohmann::json rows = nlohmann::json::array();
  struct Panel {
    frames::FrameGeometry geometry;
    uint64_t frames;
  };
  // The small panel is first: memory that it leaves allocated is too little to hide growth on the
  // large one.
  const Panel panels[] = {{{.width = 480, .height = 270}, flags.small_frames},
                          {{.width = 3840, .height = 2160}, flags.large_frames}};
  bool within = true;
  for (const Panel& panel : panels) {
    rows.push_back(row_json(measure(panel.geometry, panel.frames, flags.slots)));
    within = within && rows.back()["within_limit"].get<bool>();
    if (player::interrupted()) return player::interrupt_exit_code();
    if (!flags.json) print_row(rows.back());
  }
  const nlohmann::json budget = measure_vblank_budget(lab::bench_rig(flags.rig), flags.runs);
  if (player::interrupted()) return player::interrupt_exit_code();
  if (flags.json) {
    print_json({{"benchmark", "play"},
                {"machine", machine_json()},
                {"rows", rows},
                {"vblank_budget", budget}});
  } else {
    print_vblank_budget(budget);
    print_out("{}\n", machine_text());
  }
  return within ? kOk : kQuality;
}

}  // namespace

cli::Run declare_bench_play(CLI::App& app) {
  const auto flags = std::make_shared<BenchFlags>();
  app.add_option("--frames", flags->small_frames, "frames to play at 480x270")
      ->check(CLI::Range(1, 100'000'000))
      ->capture_default_str();
  app.add_option("--frames-4k", flags->large_frames, "frames to play at 3840x2160")
      ->check(CLI::Range(1, 100'000'000))
      ->capture_default_str();
  app.add_option("--slots", flags->slots, "slots of the ring")
      ->check(CLI::Range(3, 4096))
      ->capture_default_str();
  app.add_option("--rig", flags->rig, "rig file for the costs of frames (default: the 4K kiosk)");
  app.add_option("--runs", flags->runs, "interleaved runs of each step of a frame")
      ->check(CLI::Range(1, 1000))
      ->capture_default_str();
  app.add_flag("--json", flags->json, "print as JSON");
  return [flags] { return run_bench_play(*flags); };
}

}  // namespace lenticule::bench
