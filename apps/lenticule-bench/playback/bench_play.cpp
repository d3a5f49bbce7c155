// SPDX-License-Identifier: Apache-2.0
// Benchmarks of the player: the processor time of a frame between two vblanks, the memory of a
// player over many frames of a ring (play), the time from its start to the first frame (start), and
// the peak memory of rendering a frame (memory).
#include <fmt/format.h>
#include <signal.h>
#include <sys/resource.h>
#include <sys/types.h>
#include <sys/wait.h>
#include <unistd.h>

#include <CLI/CLI.hpp>
#include <cerrno>
#include <chrono>
#include <csignal>
#include <cstdio>
#include <cstring>
#include <filesystem>
#include <memory>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <thread>
#include <vector>

#include "apps/lenticule-bench/harness/bench.h"
#include "apps/lenticule-bench/harness/bench_scene.h"
#include "base/error.h"
#include "base/installation.h"
#include "base/main_function.h"
#include "base/print.h"
#include "display/scanout_format.h"
#include "display/virtual/virtual_display.h"
#include "frames/image_io.h"
#include "frames/ring/ring_player.h"
#include "frames/ring/ring_renderer.h"
#include "frames/sequence/sequence_reader.h"
#include "frames/sequence/sequence_writer.h"
#include "frames/weaving/fast_weaver.h"
#include "frames/weaving/reweave.h"
#include "lab/fixtures.h"
#include "optics/rig.h"
#include "optics/rig_file.h"
#include "player/playback/playback.h"
#include "player/process/interrupt.h"

namespace lenticule::bench {
namespace {

// Measures the processor time of a 4K frame on one core, from the file to the scan-out buffer,
// relative to the time between two vblanks.

constexpr double kVblankMs = 1e3 / 60.0;

/// StoredFrame is a frame in a container, which can be decoded repeatedly.
class StoredFrame {
 public:
  StoredFrame(const frames::WovenFrame& frame, const std::string& file)
      : decoded_(frame.geometry()) {
    frames::SequenceInfo info;
    info.geometry = frame.geometry();
    info.rate = {.numerator = 60, .denominator = 1};
    frames::SequenceWriter writer(file, info);
    writer.append(frame.view());
    writer.finish();
    reader_ = std::make_unique<frames::SequenceReader>(file);
    decoder_.emplace(reader_->make_decoder());
  }
  void decode() { LENTICULE_CHECK(decoder_->decode(0, decoded_.bytes())); }

 private:
  frames::WovenFrame decoded_;
  std::unique_ptr<frames::SequenceReader> reader_;
  std::optional<frames::FrameDecoder> decoder_;
};

void copy_to_scanout(const frames::WovenFrame& frame, std::vector<uint32_t>& scanout) {
  const auto width = static_cast<size_t>(frame.width());
  for (int j = 0; j < frame.height(); ++j)
    display::expand_row(display::ScanoutDepth::Bits8, frame.row(j),
                        scanout.data() + static_cast<size_t>(j) * width, width);
}

/// Milliseconds of each step, one per run.
struct StepTimes {
  std::vector<double> decode_woven, decode_views, weave, copy;
};

StepTimes time_steps(const BenchScene& scene, const frames::ViewSet& views, int runs) {
  const lab::ScratchFolder folder;
  StoredFrame woven(scene.frame(), folder.file("woven.lts"));
  StoredFrame quilt(frames::draw_quilt(views, frames::quilt_layout_for(frames::shape_of(views))),
                    folder.file("views.lts"));
  frames::FastWeaver weaver(std::make_shared<const frames::WeavePlan>(
                                scene.model(), frames::shape_of(views), frames::WeaveOptions{}),
                            1);
  frames::WovenFrame frame(scene.frame().geometry());
  std::vector<uint32_t> scanout(frame.bytes().size() / 3);
  const auto milliseconds = [](auto&& work) {
    return 1e3 * seconds_by(CLOCK_THREAD_CPUTIME_ID, work);
  };
  StepTimes times;
  for (int run = 0; run < runs && !player::interrupted(); ++run) {
    times.decode_woven.push_back(milliseconds([&] { woven.decode(); }));
    times.decode_views.push_back(milliseconds([&] { quilt.decode(); }));
    times.weave.push_back(milliseconds([&] { weaver.weave(views, frame); }));
    times.copy.push_back(milliseconds([&] { copy_to_scanout(frame, scanout); }));
  }
  return times;
}

nlohmann::json row(const std::string& source, std::optional<double> decode,
                   std::optional<double> weave, double copy) {
  const auto or_null = [](std::optional<double> ms) {
    return ms ? nlohmann::json(*ms) : nlohmann::json();
  };
  const double total = decode.value_or(0.0) + weave.value_or(0.0) + copy;
  return {{"source", source},           {"decode_ms", or_null(decode)},
          {"weave_ms", or_null(weave)}, {"copy_ms", copy},
          {"total_ms", total},          {"part_of_vblank", total / kVblankMs}};
}

/// Renders one frame of the demo scene for `rig` and measures, in `runs` interleaved runs and in
/// processor time of this thread: decoding it, decoding its views, weaving them, and copying a
/// frame into a scan-out buffer. Returns an array of rows: {"source", "decode_ms", "weave_ms",
/// "copy_ms", "total_ms", "part_of_vblank"}; null if a source has no such step. Values are medians.
/// The array is shorter when interrupted.
nlohmann::json measure_vblank_budget(const optics::Rig& rig, int runs) {
  BenchScene scene({.scene = bench_scene_name("demo"), .rig = rig});
  static_cast<void>(scene.render(*scene.method(scene.options(render::RenderOptions{}.max_depth))));
  if (player::interrupted()) return nlohmann::json::array();
  const frames::ViewSet views = frames::views_of_woven(scene.frame().view(), scene.model(),
                                                       frames::views_in_woven(scene.model().rig()));
  const StepTimes times = time_steps(scene, views, runs);
  const double copy = median(times.copy), weave = median(times.weave);
  const std::string shape =
      fmt::format("{} views of {}x{}", views.count(), views.width(), views.height());
  return {row("woven sequence", median(times.decode_woven), std::nullopt, copy),
          row("sequence of " + shape, median(times.decode_views), weave, copy),
          row("decoded quilts, " + shape, std::nullopt, weave, copy),
          row("ring", std::nullopt, std::nullopt, copy)};
}

void print_vblank_budget(const nlohmann::json& rows) {
  print_out("\none core's time per frame, and its share of a vblank at 60 Hz\n");
  constexpr Column kColumns[] = {{"", "source"},
                                 {"decode ms", "decode_ms", "{:.2f}"},
                                 {"weave ms", "weave_ms", "{:.2f}"},
                                 {"copy ms", "copy_ms", "{:.2f}"},
                                 {"total ms", "total_ms", "{:.2f}"},
                                 {"of vblank", "part_of_vblank", "{:.0f}%", 100.0}};
  print_table(rows, kColumns);
}

// lenticule bench play measures the player's memory over many frames from a renderer process
// through a real ring, in simulated time for maximum speed, and the cost per frame of each kind of
// source.

using std::chrono::milliseconds;
using std::chrono::seconds;

constexpr uint64_t kMebibyte = uint64_t{1} << 20;
constexpr uint64_t kAllowance = 64 * kMebibyte;
constexpr uint64_t kAllowedFrames = 4;

struct BenchFlags : RunFlags {
  uint64_t small_frames = 100'000;
  uint64_t large_frames = 300;
  int slots = 8;
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

nlohmann::json measure(frames::FrameGeometry geometry, uint64_t count, int slots) {
  const lab::ScratchFolder folder;
  const std::filesystem::path socket = folder.ring_socket();
  // Forked before this process has threads; the child waits for the socket to appear.
  const RendererProcess renderer(socket, count);
  const double begin = seconds_now();
  const auto ring = frames::RingPlayer::open(
      {.socket = socket, .geometry = geometry, .slots = slots, .rig_fingerprint = {}});
  const auto display = display::open_virtual_display(
      {.geometry = geometry, .clock = std::make_shared<display::SimulatedClock>()});

  const uint64_t allowed =
      (static_cast<uint64_t>(slots) + kAllowedFrames) * geometry.frame_bytes() + kAllowance;
  uint64_t early = 0;  // resident at the first report: own, ring and library pages
  const player::PlayResult result = player::play(*display, *ring,
                                                 {.prime = static_cast<uint64_t>(slots) / 2,
                                                  .filling = player::Filling::InPresenter,
                                                  .stop_fd = player::interrupt_fd(),
                                                  .on_report =
                                                      [&early](const player::PlayReport& report) {
                                                        if (early == 0) early = report.memory.total;
                                                      },
                                                  .source_name = "ring"});
  if (result.report.pace.shown != count && !player::interrupted())
    throw Error(ErrorKind::Failed,
                fmt::format("bench play: {} of {} frames shown: {} {}", result.report.pace.shown,
                            count, outcome_name(result.outcome), result.failure));
  const player::PlayReport& report = result.report;
  const uint64_t late = report.memory.total;
  return {{"width", geometry.width},
          {"height", geometry.height},
          {"frames", report.pace.shown},
          {"frames_per_s", static_cast<double>(report.pace.shown) / (seconds_now() - begin)},
          {"copy_us_p50", report.copy.p50_us},
          {"copy_us_p99", report.copy.p99_us},
          {"memory_early_bytes", early == 0 ? late : early},
          {"memory_late_bytes", late},
          {"memory_allowed_bytes", allowed},
          {"own_and_ring_bytes", report.memory.anonymous + report.memory.shared},
          {"within_limit", late <= allowed}};
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
    rows.push_back(measure(panel.geometry, panel.frames, flags.slots));
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
  flags->runs = 15;
  declare_run_flags(app, *flags);
  return [flags] { return run_bench_play(*flags); };
}

namespace {

// lenticule bench start measures the time from program start to the first frame on the virtual
// display, from outside on the program itself.

struct ProgramOutput {
  std::string text;
  double seconds = 0.0;
};

/// Runs lenticule with arguments that need no quoting in a shell.
ProgramOutput run_lenticule(const std::string& program, const std::string& arguments) {
  const double begin = seconds_now();
  std::FILE* pipe = popen(fmt::format("'{}' {} 2>/dev/null", program, arguments).c_str(), "re");
  if (pipe == nullptr) throw Error(ErrorKind::Failed, program + ": cannot start");
  ProgramOutput output;
  char buffer[4096];
  for (size_t n = 0; (n = std::fread(buffer, 1, sizeof buffer, pipe)) > 0;)
    output.text.append(buffer, n);
  const int status = pclose(pipe);
  output.seconds = seconds_now() - begin;
  if (status != 0) throw Error(ErrorKind::Failed, fmt::format("{} {}: failed", program, arguments));
  return output;
}

/// Writes a test picture; noise decodes as slowly as real frames.
void write_noise(const optics::Rig& rig, const std::string& file) {
  frames::WovenFrame frame({rig.panel.width_px, rig.panel.height_px, frames::PixelFormat::Rgb8});
  uint32_t state = 1;
  for (uint8_t& byte : frame.bytes()) {
    state = state * 1664525u + 1013904223u;
    byte = static_cast<uint8_t>(state >> 29);
  }
  frames::write_woven(frame.view(), file);
}

ExitCode run_bench_start(const RunFlags& flags) {
  const std::string program = require_program("bench", "lenticule", "lenticule-player").string();
  const optics::Rig rig = lab::bench_rig(flags.rig);
  const lab::ScratchFolder scratch;
  optics::save_rig(rig, scratch.file("rig.toml"));
  write_noise(rig, scratch.file("frame.png"));
  const std::string play =
      fmt::format("play '{}' --rig '{}' --display virtual --duration 0.1 --json",
                  scratch.file("frame.png"), scratch.file("rig.toml"));
  std::vector<double> loading;
  std::vector<double> first_frame;
  for (int i = 0; i < flags.runs && !player::interrupted(); ++i) {
    loading.push_back(1000.0 * run_lenticule(program, "--version").seconds);
    const auto report = nlohmann::json::parse(run_lenticule(program, play).text);
    first_frame.push_back(report.at("first_frame_ms").get<double>());
  }
  if (player::interrupted()) return player::interrupt_exit_code();

  const nlohmann::json result = {
      {"machine", machine_json()},
      {"width", rig.panel.width_px},
      {"height", rig.panel.height_px},
      {"runs", flags.runs},
      {"program_ms", median(loading)},
      {"first_frame_ms", median(first_frame)},
      {"start_to_first_frame_ms", median(loading) + median(first_frame)}};
  if (flags.json) {
    print_json(result);
    return kOk;
  }
  print_out("{}\n{} x {}, one PNG, virtual display, medians of {} runs\n", machine_text(),
            rig.panel.width_px, rig.panel.height_px, flags.runs);
  print_out("loading the program        {:7.0f} ms\n", result["program_ms"].get<double>());
  print_out("main() to the first frame  {:7.0f} ms\n", result["first_frame_ms"].get<double>());
  print_out("start to the first frame   {:7.0f} ms\n",
            result["start_to_first_frame_ms"].get<double>());
  return kOk;
}

}  // namespace

cli::Run declare_bench_start(CLI::App& app) {
  auto flags = std::make_shared<RunFlags>();
  declare_run_flags(app, *flags);
  return [flags] { return run_bench_start(*flags); };
}

namespace {

// lenticule bench memory measures the peak memory of one frame from outside, on a child process.

constexpr std::chrono::milliseconds kPoll{10};

struct MemoryFlags {
  std::string rig;
  std::string scene = "builtin:teapot";
  int threads = 0;
  double limit_mib = 1024.0;
  bool json = false;
};

/// Does everything that `render` does for one frame, except writing it.
void render_one(const MemoryFlags& flags) {
  BenchScene bench({.scene = bench_scene_name(flags.scene),
                    .rig = lab::bench_rig(flags.rig),
                    .threads = flags.threads});
  (void)bench.render(*bench.method(bench.options(render::RenderOptions{}.max_depth)));
}

struct ChildEnd {
  int status = 0;
  double peak_mib = 0.0;
};

/// Waits for the child in slices; a signal to this process ends the child.
ChildEnd wait_for(pid_t child) {
  while (true) {
    ChildEnd end;
    rusage usage{};
    const pid_t ended = wait4(child, &end.status, WNOHANG, &usage);
    if (ended < 0 && errno != EINTR)
      throw Error(ErrorKind::Failed, fmt::format("bench memory: {}", std::strerror(errno)));
    if (ended == child) {
      end.peak_mib = static_cast<double>(usage.ru_maxrss) / 1024.0;
      return end;
    }
    if (player::interrupted()) kill(child, SIGKILL);
    std::this_thread::sleep_for(kPoll);
  }
}

ExitCode measure_memory(const MemoryFlags& flags) {
  std::fflush(nullptr);
  const pid_t child = fork();
  if (child < 0)
    throw Error(ErrorKind::Failed,
                fmt::format("bench memory: cannot start a process: {}", std::strerror(errno)));
  if (child == 0)
    _exit(run_reporting_errors(
        [&] {
          render_one(flags);
          return kOk;
        },
        {.program = "lenticule"}));
  const ChildEnd end = wait_for(child);
  if (player::interrupted()) return player::interrupt_exit_code();
  if (!WIFEXITED(end.status))
    throw Error(ErrorKind::Failed, fmt::format("bench memory: the renderer was killed by signal {}",
                                               WTERMSIG(end.status)));
  if (WEXITSTATUS(end.status) != 0) return static_cast<ExitCode>(WEXITSTATUS(end.status));

  const bool within = end.peak_mib <= flags.limit_mib;
  if (flags.json)
    print_json({{"benchmark", "memory"},
                {"machine", machine_json()},
                {"scene", flags.scene},
                {"rig", lab::bench_rig(flags.rig).name},
                {"peak_resident_mib", end.peak_mib},
                {"limit_mib", flags.limit_mib},
                {"within_limit", within}});
  else
    print_out("peak resident    {:.1f} MiB (limit {:.0f} MiB)\n", end.peak_mib, flags.limit_mib);
  return within ? kOk : kQuality;
}

}  // namespace

cli::Run declare_bench_memory(CLI::App& app) {
  auto flags = std::make_shared<MemoryFlags>();
  app.add_option("--rig", flags->rig, "rig file (default: the 4K kiosk)");
  app.add_option("--scene", flags->scene, "as for render")->capture_default_str();
  declare_threads(app, flags->threads);
  app.add_option("--limit-mib", flags->limit_mib, "limit; a larger peak gives exit code 5")
      ->capture_default_str();
  app.add_flag("--json", flags->json, "print as JSON");
  return [flags]() -> ExitCode { return measure_memory(*flags); };
}
}  // namespace lenticule::bench
