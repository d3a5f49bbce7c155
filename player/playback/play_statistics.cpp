// SPDX-License-Identifier: Apache-2.0
#include "player/playback/play_statistics.h"

#include <fmt/format.h>

#include <cstdio>
#include <fstream>

#include "base/print.h"

namespace lenticule::player {
namespace {

using nlohmann::ordered_json;

ordered_json pace_json(const PaceCounts& pace) {
  return {{"vblanks", pace.vblanks},
          {"shown", pace.shown},
          {"repeated_planned", pace.repeated_planned},
          {"repeated_underrun", pace.repeated_underrun},
          {"missed_vblanks", pace.missed},
          {"held", pace.held},
          {"dropped", pace.dropped},
          {"skipped_planned", pace.skipped_planned},
          {"slipped_vblanks", pace.slipped},
          {"underruns", pace.underruns},
          {"underruns_after_start", pace.underruns_after_start}};
}

}  // namespace

ordered_json latency_json(const LatencySummary& latency) {
  return {{"count", latency.count},
          {"p50", latency.p50_us},
          {"p99", latency.p99_us},
          {"max", latency.max_us}};
}

ResidentMemory read_resident_memory() {
  ResidentMemory memory;
  std::ifstream file("/proc/self/status");
  for (std::string line; std::getline(file, line);) {
    unsigned long long kibibytes = 0;
    const auto is = [&](const char* pattern) {
      return std::sscanf(line.c_str(), pattern, &kibibytes) == 1;
    };
    if (is("VmRSS: %llu kB")) memory.total = kibibytes * 1024;
    if (is("RssAnon: %llu kB")) memory.anonymous = kibibytes * 1024;
    if (is("RssShmem: %llu kB")) memory.shared = kibibytes * 1024;
    if (is("VmHWM: %llu kB")) memory.peak = kibibytes * 1024;
  }
  return memory;
}

nlohmann::ordered_json to_json(const PlayReport& report) {
  ordered_json json = {{"outcome", report.outcome},
                       {"source", report.source},
                       {"display", report.display},
                       {"width", report.geometry.width},
                       {"height", report.geometry.height},
                       {"clock", report.hardware_clock ? "hardware" : "software"},
                       {"refresh", frames::to_string(report.refresh)},
                       {"refresh_hz", report.refresh.hertz()},
                       {"refresh_measured_hz", report.refresh_measured_hz},
                       {"content_rate", frames::to_string(report.content_rate)},
                       {"late_policy", late_policy_name(report.late)},
                       {"real_time_priority", report.real_time},
                       {"off", report.off},
                       {"first_frame_ms", report.first_frame_ms}};
  json.update(pace_json(report.pace));
  for (const auto& [name, field] : kPresenterCounters<uint64_t>) json[name] = report.*field;
  for (const auto& [name, field] : kFrameCopierCounters<uint64_t>) json[name] = report.*field;
  json.update({{"ring_fill", {{"min", report.ready_min}, {"avg", report.ready_avg}}},
               {"capture_to_submit_us", latency_json(report.capture_to_submit)},
               {"submit_to_flip_us", latency_json(report.submit_to_flip)},
               {"wake_latency_us", latency_json(report.wake)},
               {"copy_us", latency_json(report.copy)},
               {"resident_bytes",
                {{"total", report.memory.total},
                 {"anonymous", report.memory.anonymous},
                 {"shared", report.memory.shared},
                 {"peak", report.memory.peak}}},
               {"log_lines_dropped", dropped_log_lines()}});
  return json;
}

ordered_json to_json(const frames::FrameDamage& damage) {
  return {{"damaged_frames", damage.damaged},
          {"missing_frames", damage.missing},
          {"repeated_frames", damage.repeated}};
}

std::string damage_text(const frames::FrameDamage& damage) {
  return fmt::format("{} frames damaged, {} missing, {} repeated", damage.damaged, damage.missing,
                     damage.repeated);
}

std::string summary_text(const PlayReport& report) {
  const PaceCounts& pace = report.pace;
  const std::string first = pace.shown > 0
                                ? fmt::format("first frame after {:.0f} ms", report.first_frame_ms)
                                : "no frame was shown";
  return fmt::format(
      "{} on {}: {} frames in {} vblanks, {} repeated by plan, {} by underrun ({} underruns, {} "
      "after start-up), {} missed, {} dropped\n"
      "{}; submit to flip {:.1f} ms median, copy {:.1f} ms median, {:.1f} "
      "ms at most; {} MiB resident",
      escaped(report.source), escaped(report.display), pace.shown, pace.vblanks,
      pace.repeated_planned, pace.repeated_underrun, pace.underruns, pace.underruns_after_start,
      pace.missed, pace.dropped, first, report.submit_to_flip.p50_us / 1000,
      report.copy.p50_us / 1000, report.copy.max_us / 1000, report.memory.total >> 20);
}

}  // namespace lenticule::player
