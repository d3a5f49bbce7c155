// SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>
#include <sys/epoll.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <chrono>
#include <cmath>
#include <cstring>
#include <numeric>
#include <vector>

#include "apps/lenticule-bench/harness/bench.h"
#include "apps/lenticule-bench/harness/bench_timing.h"
#include "apps/lenticule-bench/realtime/realtime.h"
#include "apps/lenticule-bench/realtime/timed_display.h"
#include "apps/lenticule-tools/offline/scratch_folder.h"
#include "base/error.h"
#include "display/virtual/virtual_display.h"
#include "frames/ring/ring_player.h"
#include "player/playback/playback.h"
#include "player/process/interrupt.h"

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

double milliseconds_of(int64_t ns) {
  return static_cast<double>(ns) * 1e-6;
}

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

json measure_realtime(const LiveSetup& setup, const PlayerSetup& player) {
  const frames::FrameGeometry geometry = {setup.rig.panel.width_px, setup.rig.panel.height_px,
                                          frames::PixelFormat::Rgb8};
  const tools::ScratchFolder folder;
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
  log.set_player_finished(player::interrupted());
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
      log.frames().empty() ? 0.0 : log.cpu_s() / static_cast<double>(log.frames().size());
  figures["interrupted"] = player::interrupted();
  if (log.frames().empty() && !player::interrupted())
    throw Error(ErrorKind::Failed,
                fmt::format("bench realtime: no frame was shown: {} {}",
                            outcome_name(result.outcome), result.failure),
                "the renderer process ended, or took more than ten minutes for a frame");
  return figures;
}

}  // namespace lenticule::bench
