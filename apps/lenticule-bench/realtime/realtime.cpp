// SPDX-License-Identifier: Apache-2.0
// lenticule bench realtime renders moving scenes into the ring of a player, and measures frames per
// second, latency, missed vblanks, error and memory.

#include <fmt/format.h>
#include <sys/epoll.h>
#include <unistd.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <array>
#include <cerrno>
#include <chrono>
#include <cmath>
#include <cstring>
#include <filesystem>
#include <memory>
#include <numeric>
#include <string>
#include <vector>

#include "apps/lenticule-bench/harness/bench.h"
#include "apps/lenticule-bench/harness/bench_scene.h"
#include "apps/lenticule-bench/harness/svg_plot.h"
#include "apps/lenticule-bench/realtime/live_renderer.h"
#include "apps/lenticule-tools/offline/film_renderer.h"
#include "base/error.h"
#include "base/print.h"
#include "display/virtual/virtual_display.h"
#include "frames/ring/ring_player.h"
#include "lab/fixtures.h"
#include "player/playback/playback.h"
#include "player/process/interrupt.h"
#include "render/methods/method.h"

namespace lenticule::bench {

namespace {

using player::PlayReport;

using nlohmann::json;

/// Longest wait for the first frame: loading a scene and rendering two frames.
constexpr std::chrono::minutes kFrameTimeout{10};
constexpr double kMebibyte = 1024.0 * 1024.0;
/// Points of a course, so that long runs have small files.
constexpr double kMostPoints = 240.0;

/// Returns a descriptor that is readable when one of the others is.
UniqueFd any_of(std::span<const int> descriptors) {
  UniqueFd set(epoll_create1(EPOLL_CLOEXEC));
  bool made = static_cast<bool>(set);
  for (const int fd : descriptors) {
    epoll_event event = {.events = EPOLLIN, .data = {}};
    made = made && epoll_ctl(set.get(), EPOLL_CTL_ADD, fd, &event) == 0;
  }
  if (!made) throw Error(ErrorKind::Failed, fmt::format("bench realtime: {}", strerror(errno)));
  return set;
}

double milliseconds_of(int64_t ns) { return static_cast<double>(ns) * 1e-6; }

double mean(const std::vector<double>& values) {
  return values.empty() ? 0.0
                        : std::accumulate(values.begin(), values.end(), 0.0) /
                              static_cast<double>(values.size());
}

/// A stage of the renderer's loop, or of a frame's way to the panel.
struct Stage {
  const char* name;
  int64_t (*ns)(const FrameRecord& frame);
};

/// The stages in which the renderer works on a frame or waits with it.
constexpr std::array kWork = {
    Stage{"scene", [](const FrameRecord& f) { return f.committed_ns - f.begun_ns; }},
    Stage{"render", [](const FrameRecord& f) { return f.rendered_ns - f.committed_ns; }},
    Stage{"ring", [](const FrameRecord& f) { return f.acquired_ns - f.rendered_ns; }},
    Stage{"copy", [](const FrameRecord& f) { return f.published_ns - f.acquired_ns; }},
};

/// Returns the shares of the renderer's time, and as "bound" the largest one's name.
void add_shares(std::span<const FrameRecord> frames, json& figures) {
  const auto all = static_cast<double>(frames.back().published_ns - frames.front().free_ns);
  double other = 1.0;
  double largest = 0.0;
  const auto add = [&](const char* name, int64_t (*ns)(const FrameRecord&)) {
    double sum = 0.0;
    for (const FrameRecord& frame : frames) sum += static_cast<double>(ns(frame));
    const double share = all > 0.0 ? sum / all : 0.0;
    figures["shares"][name] = share;
    other -= share;
    if (share <= largest) return;
    largest = share;
    figures["bound"] = name;
  };
  for (const Stage& stage : kWork) add(stage.name, stage.ns);
  add("wait", [](const FrameRecord& f) { return f.begun_ns - f.free_ns; });
  figures["shares"]["other"] = std::max(other, 0.0);
}

/// Means over a tenth of the frames, since the memory of single frames wavers.
json memory_of(std::span<const FrameRecord> frames) {
  const size_t tenth = std::max<size_t>(frames.size() / 10, 1);
  const std::span<const FrameRecord> second =
      frames.subspan(std::min(tenth, frames.size() - tenth), tenth);
  const std::span<const FrameRecord> last = frames.last(tenth);
  const auto mean = [](std::span<const FrameRecord> of, uint64_t FrameRecord::*bytes) {
    double sum = 0.0;
    for (const FrameRecord& frame : of) sum += static_cast<double>(frame.*bytes);
    return sum / static_cast<double>(of.size()) / kMebibyte;
  };
  const uint64_t peak = std::ranges::max(frames, {}, &FrameRecord::memory_bytes).memory_bytes;
  return {{"start", static_cast<double>(frames.front().memory_bytes) / kMebibyte},
          {"tenth", mean(second, &FrameRecord::memory_bytes)},
          {"end", mean(last, &FrameRecord::memory_bytes)},
          {"peak", static_cast<double>(peak) / kMebibyte},
          {"in_use_tenth", mean(second, &FrameRecord::in_use_bytes)},
          {"in_use_end", mean(last, &FrameRecord::in_use_bytes)}};
}

json errors_of(std::span<const FrameRecord> frames) {
  std::vector<double> errors;
  for (const FrameRecord& frame : frames) errors.push_back(frame.tolerated_error);
  return {{"least", quantile(errors, 0.0)},
          {"median", quantile(errors, 0.5)},
          {"most", quantile(errors, 1.0)},
          {"last", errors.empty() ? 0.0 : errors.back()}};
}

/// A frame that appeared on the panel.
struct Shown {
  const FrameRecord* frame;
  int64_t ns;
};

std::vector<Shown> shown_of(std::span<const FrameRecord> frames,
                            std::span<const int64_t> shown_ns) {
  std::vector<Shown> shown;
  for (size_t n = 0; n < std::min(frames.size(), shown_ns.size()); ++n)
    if (shown_ns[n] != 0) shown.push_back({&frames[n], shown_ns[n]});
  return shown;
}

/// Returns means over equal parts of the time, each at least a second and with a frame.
json course_of(const std::vector<Shown>& shown) {
  json course = json::array();
  if (shown.empty()) return course;
  const int64_t first = shown.front().ns;
  const double length = static_cast<double>(shown.back().ns - first) * 1e-9;
  const double part_s = std::max(1.0, length / kMostPoints);
  for (size_t begin = 0; begin < shown.size();) {
    size_t end = begin + 1;
    const auto seconds = [&](size_t n) { return static_cast<double>(shown[n].ns - first) * 1e-9; };
    while (end < shown.size() && seconds(end) - seconds(begin) < part_s) ++end;
    double latency = 0.0, error = 0.0, square = 0.0;
    for (size_t n = begin; n < end; ++n) {
      const FrameRecord& frame = *shown[n].frame;
      latency += milliseconds_of(shown[n].ns - frame.due_ns);
      error += frame.tolerated_error;
      square += frame.audited_rmse * frame.audited_rmse;
    }
    const auto count = static_cast<double>(end - begin);
    if (end < shown.size())
      course.push_back({{"at_s", seconds(begin)},
                        {"frames_per_s", count / (seconds(end) - seconds(begin))},
                        {"latency_ms", latency / count},
                        {"tolerated_error", error / count},
                        {"audited_rmse", std::sqrt(square / count)}});
    begin = end;
  }
  return course;
}

void add_latencies(const std::vector<Shown>& shown, json& figures) {
  std::vector<double> latencies;
  for (const Shown& one : shown) latencies.push_back(milliseconds_of(one.ns - one.frame->due_ns));
  figures["latency_ms"] = {{"p50", quantile(latencies, 0.5)},
                           {"p99", quantile(latencies, 0.99)},
                           {"max", quantile(latencies, 1.0)},
                           {"mean", mean(latencies)}};
  const auto add = [&](const char* name, const auto& ns) {
    std::vector<double> times;
    for (const Shown& one : shown) times.push_back(milliseconds_of(ns(one)));
    figures["latency_parts_ms"][name] = mean(times);
  };
  add("begin", [](const Shown& s) { return s.frame->begun_ns - s.frame->due_ns; });
  for (const Stage& stage : kWork)
    add(stage.name, [&stage](const Shown& s) { return stage.ns(*s.frame); });
  add("panel", [](const Shown& s) { return s.ns - s.frame->published_ns; });
}

json player_json(const PlayReport& first, const player::PlayResult& result, double cpu_s) {
  const PlayReport& report = result.report;
  const auto mebibytes = [](const player::ResidentMemory& memory) {
    return static_cast<double>(memory.anonymous + memory.shared) / kMebibyte;
  };
  const double vblanks = std::max(1.0, static_cast<double>(report.pace.vblanks));
  return {{"refresh_hz", report.refresh.hertz()},
          {"real_time", report.real_time},
          {"vblanks", report.pace.vblanks},
          {"shown", report.pace.shown},
          {"missed_vblanks", report.pace.missed},
          {"repeated", report.pace.repeated_underrun},
          {"late_submits", report.late_submits},
          {"copy_ms_p50", report.copy.p50_us * 1e-3},
          {"copy_ms_p99", report.copy.p99_us * 1e-3},
          {"wake_ms_p99", report.wake.p99_us * 1e-3},
          {"cpu_of_vblank", cpu_s / vblanks * report.refresh.hertz()},
          {"memory_mib", {{"start", mebibytes(first.memory)}, {"end", mebibytes(report.memory)}}}};
}

/// Adds the renderer's messages about samples, and their summary. Throws the renderer's error, and
/// Error(Failed) if the renderer ended too early.
void add_samples(RendererProcess& renderer, std::span<const FrameRecord> frames, json& figures) {
  figures["samples"] = json::array();
  for (const char* key : {"rmse", "psnr_db", "psnr_worst_db", "max"}) figures[key] = nullptr;
  std::vector<double> errors;
  int largest = 0;
  for (;;) {
    const std::optional<json> message = renderer.next_message();
    if (!message && player::interrupted()) break;
    if (!message)
      throw Error(ErrorKind::Failed,
                  fmt::format("bench realtime: the renderer process ended or hangs after {} frames",
                              frames.size()),
                  "see the kernel's log: was it killed because memory is short?");
    if (const auto failed = message->find("failed"); failed != message->end())
      throw Error(message->at("kind").get<ErrorKind>(), failed->get<std::string>(),
                  message->at("hint").get<std::string>());
    if (message->contains("finished")) break;
    json sample = message->at("sample");
    const FrameRecord& frame = frames[sample.at("frame").get<size_t>()];
    sample["at_s"] = static_cast<double>(frame.due_ns - frames.front().due_ns) * 1e-9;
    errors.push_back(sample.at("mse").get<double>());
    largest = std::max(largest, sample.at("max").get<int>());
    figures["samples"].push_back(std::move(sample));
  }
  if (errors.empty()) return;
  figures["rmse"] = std::sqrt(mean(errors));
  figures["psnr_db"] = psnr_or_null(mean(errors));
  figures["psnr_worst_db"] = psnr_or_null(std::ranges::max(errors));
  figures["max"] = largest;
}

}  // namespace

json live_figures(std::span<const FrameRecord> frames, std::span<const int64_t> shown_ns) {
  const std::vector<Shown> shown = shown_of(frames, shown_ns);
  const double seconds =
      shown.size() < 2 ? 0.0 : static_cast<double>(shown.back().ns - shown.front().ns) * 1e-9;
  json figures = {
      {"frames_rendered", frames.size()},
      {"frames_shown", shown.size()},
      {"seconds_shown", seconds},
      {"frames_per_s", seconds > 0.0 ? static_cast<double>(shown.size() - 1) / seconds : 0.0},
      {"shares", json::object()},
      {"bound", "nothing"},
      {"memory_mib",
       {{"start", 0.0},
        {"tenth", 0.0},
        {"end", 0.0},
        {"peak", 0.0},
        {"in_use_tenth", 0.0},
        {"in_use_end", 0.0}}},
      {"error_range", errors_of(frames)},
      {"course", course_of(shown)}};
  if (!frames.empty()) {
    add_shares(frames, figures);
    figures["memory_mib"] = memory_of(frames);
  }
  add_latencies(shown, figures);
  return figures;
}

namespace {

struct PlayerSetup {
  frames::Rate refresh{60, 1};
  int slots = 3;
};

/// Plays the frames of a renderer process on a virtual display, in this process. Returns
/// live_figures() with {"scene", "rig", "width", "height", "method", "tolerated_error",
/// "proven_rmse", "adapt_rate" (null: none), "interrupted", "player": {...}, "samples": [...],
/// "rmse", "psnr_db", "psnr_worst_db", "max"}; the last four are null if no sample was compared,
/// and a PSNR is null if the frames are equal. This process must not have other threads. Throws the
/// renderer's errors.
json measure_realtime(const LiveSetup& setup, const PlayerSetup& player) {
  const frames::FrameGeometry geometry = {setup.rig.panel.width_px, setup.rig.panel.height_px,
                                          frames::PixelFormat::Rgb8};
  const lab::ScratchFolder folder;
  const std::filesystem::path socket = folder.ring_socket();
  RunLog log(most_frames(setup));
  // Forked before this process has threads; the renderer waits for the socket to appear.
  RendererProcess renderer(setup, socket, log);
  const auto ring = frames::RingPlayer::open(
      {.socket = socket, .geometry = geometry, .slots = player.slots, .rig_fingerprint = {}});
  const auto panel =
      display::open_virtual_display({.geometry = geometry, .refresh = player.refresh});
  TimedDisplay display(*panel, log.capacity());
  const int stops[] = {player::interrupt_fd(), renderer.message_fd()};
  const UniqueFd stop = any_of(stops);

  PlayReport first;
  const double cpu_s = process_cpu_seconds();
  const player::PlayResult result =
      player::play(display, *ring,
                   {.prime = 1,
                    .stall_timeout = kFrameTimeout,
                    .real_time_priority = true,
                    .stop_fd = stop.get(),
                    .on_report =
                        [&first](const PlayReport& report) {
                          if (first.memory.total == 0 && report.pace.shown > 0) first = report;
                        },
                    .source_name = "ring"});
  const double player_cpu_s = process_cpu_seconds() - cpu_s;
  log.state().stop = player::interrupted();
  log.state().player_finished = true;
  if (first.memory.total == 0) first = result.report;

  json figures = live_figures(log.frames(), display.shown_ns());
  figures.update({{"scene", setup.scene},
                  {"rig", setup.rig.name},
                  {"width", geometry.width},
                  {"height", geometry.height},
                  {"method", setup.entrant.name},
                  {"tolerated_error", nullptr},
                  {"proven_rmse", setup.entrant.proven_rmse},
                  {"adapt_rate", nullptr},
                  {"player", player_json(first, result, player_cpu_s)}});
  if (setup.adapt_rate)
    figures["adapt_rate"] = *setup.adapt_rate;
  else if (setup.entrant.tolerated)
    figures["tolerated_error"] = *setup.entrant.tolerated;
  add_samples(renderer, log.frames(), figures);
  figures["cpu_s_per_frame"] =
      log.frames().empty() ? 0.0 : log.state().cpu_s / static_cast<double>(log.frames().size());
  figures["interrupted"] = player::interrupted();
  if (log.frames().empty() && !player::interrupted())
    throw Error(ErrorKind::Failed,
                fmt::format("bench realtime: no frame was shown: {} {}",
                            outcome_name(result.outcome), result.failure),
                "the renderer process ended, or took more than ten minutes for a frame");
  return figures;
}

double number(const json& from, const char* key) { return from.at(key).get<double>(); }

/// Returns the name of a share as a sentence has it.
std::string bound_text(const std::string& name) {
  if (name == "scene") return "evaluating and committing the scene";
  if (name == "render") return "rendering";
  if (name == "ring") return "waiting for a free slot of the ring";
  if (name == "copy") return "copying into the ring";
  if (name == "wait") return "waiting for the next frame of the scene";
  return name;
}

std::string error_text(const json& run) {
  if (run.at("rmse").is_null()) return "not compared with method full";
  if (run.at("psnr_db").is_null())
    return fmt::format("none: {} frames equal those of method full", run.at("samples").size());
  return fmt::format(
      "RMSE {:.2f}, PSNR {} dB, worst frame {} dB, largest {} code values; {} frames",
      number(run, "rmse"), decibels(run.at("psnr_db")), decibels(run.at("psnr_worst_db")),
      run.at("max").get<int>(), run.at("samples").size());
}

PlotSeries course_series(const json& run, const char* label, const char* key) {
  PlotSeries series{.label = label, .points = {}};
  for (const json& point : run.at("course"))
    if (const double value = number(point, key); value > 0.0)
      series.points.push_back({number(point, "at_s"), value});
  return series;
}

void print_realtime(const json& run) {
  const json& latency = run.at("latency_ms");
  const json& parts = run.at("latency_parts_ms");
  const json& shares = run.at("shares");
  const json& player = run.at("player");
  const json& memory = run.at("memory_mib");
  print_out("{}, {}, {} x {}, {}\n", run.at("scene").get<std::string>(),
            run.at("rig").get<std::string>(), run.at("width").get<int>(),
            run.at("height").get<int>(), run.at("method").get<std::string>());
  print_out(
      "  rate     {:.2f} frames/s: {} shown of {} rendered in {:.1f} s; {:.3f} s of processor "
      "time each\n",
      number(run, "frames_per_s"), run.at("frames_shown").get<uint64_t>(),
      run.at("frames_rendered").get<uint64_t>(), number(run, "seconds_shown"),
      number(run, "cpu_s_per_frame"));
  print_out(
      "  latency  {:.0f} ms from the scene's instant to the panel; p99 {:.0f}, largest {:.0f}\n",
      number(latency, "p50"), number(latency, "p99"), number(latency, "max"));
  print_out(
      "           means: begin {:.1f}, scene {:.1f}, render {:.1f}, ring {:.1f}, copy {:.1f}, "
      "panel {:.1f}\n",
      number(parts, "begin"), number(parts, "scene"), number(parts, "render"),
      number(parts, "ring"), number(parts, "copy"), number(parts, "panel"));
  if (const std::string bound = run.at("bound"); shares.contains(bound))
    print_out("  bound    {}: {:.1f} % of the renderer's time\n", bound_text(bound),
              100.0 * number(shares, bound.c_str()));
  print_out(
      "  player   {} of {} vblanks missed, {} submitted late; wakes within {:.1f} ms (p99){}; "
      "{:.1f} "
      "ms to copy a frame; {:.1f} % of a core\n",
      player.at("missed_vblanks").get<uint64_t>(), player.at("vblanks").get<uint64_t>(),
      player.at("late_submits").get<uint64_t>(), number(player, "wake_ms_p99"),
      player.at("real_time").get<bool>() ? "" : ", without real-time priority",
      number(player, "copy_ms_p50"), 100.0 * number(player, "cpu_of_vblank"));
  print_out("  error    {}\n", error_text(run));
  if (const json& range = run.at("error_range"); !run.at("adapt_rate").is_null())
    print_out("  E        {:.2f} to {:.2f} code values, median {:.2f}, last {:.2f}\n",
              number(range, "least"), number(range, "most"), number(range, "median"),
              number(range, "last"));
  print_out(
      "  memory   renderer {:.0f} MiB at first, {:.0f} after a tenth, {:.0f} at the end, of which "
      "in use {:.2f} -> {:.2f}; player {:.0f} -> {:.0f} MiB\n\n",
      number(memory, "start"), number(memory, "tenth"), number(memory, "end"),
      number(memory, "in_use_tenth"), number(memory, "in_use_end"),
      number(player.at("memory_mib"), "start"), number(player.at("memory_mib"), "end"));
}

/// Prints a row per run, if there are several.
void print_realtime_table(const json& runs) {
  if (runs.size() < 2) return;
  constexpr Column kColumns[] = {{"scene", "scene"},
                                 {"method", "method"},
                                 {"frames/s", "frames_per_s", "{:.2f}"},
                                 {"ms p50", "latency_ms/p50"},
                                 {"ms p99", "latency_ms/p99"},
                                 {"missed", "player/missed_vblanks"},
                                 {"dB", "psnr_db", "{:.1f}"},
                                 {"bound", "bound"},
                                 {"MiB", "memory_mib/tenth"},
                                 {"end", "memory_mib/end"}};
  print_table(runs, kColumns);
}

}  // namespace

void plot_realtime(const json& run, const std::string& file) {
  Plot plot{.title = fmt::format("{}, {} x {}, {}", run.at("scene").get<std::string>(),
                                 run.at("width").get<int>(), run.at("height").get<int>(),
                                 run.at("method").get<std::string>()),
            .x = {.label = "seconds"},
            .y = {.label = "frames/s, code values", .scale = AxisScale::Log},
            .series = {course_series(run, "frames/s", "frames_per_s"),
                       course_series(run, "tolerated E", "tolerated_error"),
                       course_series(run, "RMSE, audit", "audited_rmse")}};
  PlotSeries measured{.label = "RMSE, measured", .points = {}, .joined = false};
  for (const json& sample : run.at("samples"))
    if (const double mse = number(sample, "mse"); mse > 0.0)
      measured.points.push_back({number(sample, "at_s"), std::sqrt(mse)});
  plot.series.push_back(std::move(measured));
  std::erase_if(plot.series, [](const PlotSeries& series) { return series.points.empty(); });
  if (!plot.series.empty()) write_svg(plot, file);
}

namespace {

struct RealtimeFlags {
  std::vector<std::string> scenes = {"teapot", "room", "small-balls", "primitives", "tree"};
  std::vector<std::string> rigs;
  std::vector<std::string> methods = {"adaptive"};
  std::vector<double> errors = {2.0};
  std::vector<double> psnrs = {40.0};
  std::vector<double> adapt_rates;
  double seconds = 60.0;
  std::string fps = "30";
  std::string refresh = "60";
  int samples = 5;
  int slots = 3;
  int threads = 0;
  int depth = 5;
  bool json = false;
  std::string plots;
};

std::vector<optics::Rig> rigs_of(const RealtimeFlags& flags) {
  std::vector<optics::Rig> rigs;
  for (const std::string& file : flags.rigs) rigs.push_back(lab::bench_rig(file));
  if (rigs.empty()) rigs = {lab::coarser_rig(lab::kiosk_rig(), 2), lab::kiosk_rig()};
  return rigs;
}

std::vector<ErrorEntrant> entrants_of(const RealtimeFlags& flags) {
  const auto& known = render::method_names();
  std::vector<ErrorEntrant> entrants =
      error_entrants(flags.methods, flags.errors, flags.psnrs, known);
  if (std::ranges::find(flags.methods, "full") == flags.methods.end())
    entrants.erase(entrants.begin());
  for (const ErrorEntrant& entrant : entrants)
    if (!entrant.exists)
      throw Error(ErrorKind::Usage, fmt::format("--methods: no method '{}'", entrant.method),
                  fmt::format("methods are {}", fmt::join(known, ", ")));
  if (entrants.empty())
    throw Error(ErrorKind::Usage, "--methods: adaptive without an error",
                "give --errors or --psnrs");
  return entrants;
}

/// A method, and the rate for which its error is adapted.
struct Case {
  ErrorEntrant entrant;
  std::optional<double> adapt_rate{};
};

std::vector<Case> cases_of(const RealtimeFlags& flags, bool errors_given) {
  std::vector<Case> cases;
  if (flags.adapt_rates.empty() || errors_given)
    for (const ErrorEntrant& entrant : entrants_of(flags)) cases.push_back({.entrant = entrant});
  for (const double rate : flags.adapt_rates) {
    static_cast<void>(tools::ErrorController(rate));  // checks the rate before the first run
    cases.push_back({.entrant = {.name = fmt::format("adaptive {:g}/s", rate),
                                 .method = "adaptive",
                                 .tolerated = tools::ErrorController::kFirstError},
                     .adapt_rate = rate});
  }
  return cases;
}

class RealtimeRun {
 public:
  RealtimeRun(const RealtimeFlags& flags, bool errors_given)
      : flags_(flags),
        fps_(frames::parse_rate(flags.fps)),
        refresh_(frames::parse_rate(flags.refresh)),
        rigs_(rigs_of(flags)),
        cases_(cases_of(flags, errors_given)) {
    if (fps_.hertz() > refresh_.hertz())
      throw Error(ErrorKind::Usage, "--fps: more than --refresh, so frames would never be shown");
    if (!flags.plots.empty()) std::filesystem::create_directories(flags.plots);
  }

  ExitCode run() {
    if (!flags_.json)
      print_out("machine    {}\nrun        {:g} s each, {} scene frames/s, panel {} Hz\n\n",
                machine_text(), flags_.seconds, flags_.fps, flags_.refresh);
    for (const optics::Rig& rig : rigs_)
      for (const std::string& scene : flags_.scenes)
        for (const Case& one : cases_)
          if (!player::interrupted()) measure(rig, scene, one);
    if (flags_.json)
      print_json({{"benchmark", "realtime"},
                  {"machine", machine_json()},
                  {"seconds", flags_.seconds},
                  {"fps", fps_.hertz()},
                  {"runs", runs_}});
    else
      print_realtime_table(runs_);
    return player::interrupt_exit_code();
  }

 private:
  void measure(const optics::Rig& rig, const std::string& scene, const Case& one) {
    const nlohmann::json run = measure_realtime({.scene = scene,
                                                 .rig = rig,
                                                 .entrant = one.entrant,
                                                 .seconds = flags_.seconds,
                                                 .fps = fps_,
                                                 .threads = flags_.threads,
                                                 .depth = flags_.depth,
                                                 .adapt_rate = one.adapt_rate,
                                                 .samples = flags_.samples},
                                                {.refresh = refresh_, .slots = flags_.slots});
    runs_.push_back(run);
    if (!flags_.json) {
      print_realtime(run);
      flush_results();
    }
    if (!flags_.plots.empty()) plot_realtime(run, plot_file(rig, scene, one.entrant));
  }

  [[nodiscard]] std::string plot_file(const optics::Rig& rig, const std::string& scene,
                                      const ErrorEntrant& entrant) const {
    std::string name = fmt::format("{}-{}-{}.svg", scene, rig.panel.height_px, entrant.name);
    std::ranges::replace_if(
        name, [](char c) { return c == ' ' || c == '/' || c == ':'; }, '-');
    return (std::filesystem::path(flags_.plots) / name).string();
  }

  const RealtimeFlags& flags_;
  frames::Rate fps_;
  frames::Rate refresh_;
  std::vector<optics::Rig> rigs_;
  std::vector<Case> cases_;
  nlohmann::json runs_ = nlohmann::json::array();
};

}  // namespace

cli::Run declare_bench_realtime(CLI::App& app) {
  auto shared = std::make_shared<RealtimeFlags>();
  RealtimeFlags& flags = *shared;
  const auto list = [&](const char* name, auto& values, const char* help) {
    return app.add_option(name, values, help)->allow_extra_args(false)->delimiter(',');
  };
  app.add_option("scenes", flags.scenes,
                 "built-in scenes, as for render, or gltf:NAME for one that is written as glTF")
      ->capture_default_str();
  app.add_option("--rig", flags.rigs,
                 "rig file; repeatable (default: the Full HD and the 4K kiosk)")
      ->allow_extra_args(false);
  list("--methods", flags.methods, "render methods")->capture_default_str();
  list("--errors", flags.errors,
       "error that adaptive may make, in code values; without the default --psnrs")
      ->capture_default_str();
  list("--psnrs", flags.psnrs, "PSNR that adaptive must prove, in dB; without the default --errors")
      ->capture_default_str();
  list("--adapt-error", flags.adapt_rates,
       "frames per second that adaptive holds by choosing the error of each frame, 0.5 to 16 code "
       "values; instead of --errors and --psnrs unless these are given");
  app.add_option("--seconds", flags.seconds, "length of each run")
      ->check(CLI::Range(0.1, 86400.0))
      ->capture_default_str();
  app.add_option("--fps", flags.fps,
                 "frames of the scene per second; the renderer takes the one due")
      ->capture_default_str();
  app.add_option("--refresh", flags.refresh, "vblanks of the panel per second")
      ->capture_default_str();
  app.add_option("--samples", flags.samples,
                 "frames of each run that are compared with method full afterwards")
      ->check(CLI::Range(0, 100))
      ->capture_default_str();
  app.add_option("--slots", flags.slots, "slots of the ring")
      ->check(CLI::Range(3, 64))
      ->capture_default_str();
  declare_depth(app, "--max-depth", flags.depth);
  declare_threads(app, flags.threads);
  app.add_option("--plots", flags.plots,
                 "folder for a plot of each run: rate, tolerated error and error over time");
  app.add_flag("--json", flags.json, "print as JSON");
  app.footer(
      "Example:\n  lenticule bench realtime teapot --rig scenes/rigs/kiosk-27-4k.toml --errors 2 "
      "--psnrs 40\n");
  return [shared, &app] {
    const bool errors = app.count("--errors") > 0;
    const bool psnrs = app.count("--psnrs") > 0;
    if (psnrs && !errors) shared->errors.clear();
    if (errors && !psnrs) shared->psnrs.clear();
    return RealtimeRun(*shared, errors || psnrs).run();
  };
}
}  // namespace lenticule::bench
