// SPDX-License-Identifier: Apache-2.0
#include "player/playback/play_statistics.h"

#include <fmt/format.h>

#include <algorithm>
#include <bit>
#include <cstdio>
#include <fstream>

#include "base/print.h"

namespace lenticule::player {
namespace {

constexpr double kNanosecondsPerMicrosecond = 1000.0;

}  // namespace

size_t LatencyHistogram::bin_of(uint64_t value) noexcept {
  constexpr uint64_t kSubBins = uint64_t{1} << kBinBits;
  if (value < kSubBins) return static_cast<size_t>(value);
  const int shift = static_cast<int>(std::bit_width(value)) - 1 - kBinBits;
  const uint64_t bin = (static_cast<uint64_t>(shift) << kBinBits) + (value >> shift);
  return static_cast<size_t>(std::min<uint64_t>(bin, kBins - 1));
}

uint64_t LatencyHistogram::upper_bound_of(size_t bin) noexcept {
  constexpr uint64_t kSubBins = uint64_t{1} << kBinBits;
  if (bin < kSubBins) return bin;
  const auto shift = (bin >> kBinBits) - 1;
  return (((bin & (kSubBins - 1)) + kSubBins + 1) << shift) - 1;
}

void LatencyHistogram::record(std::chrono::nanoseconds duration) noexcept {
  const auto value = static_cast<uint64_t>(std::max<int64_t>(duration.count(), 0));
  auto& bin = bins_[bin_of(value)];
  bin.store(bin.load(std::memory_order_relaxed) + 1, std::memory_order_relaxed);
  if (value > max_.load(std::memory_order_relaxed)) max_.store(value, std::memory_order_relaxed);
}

LatencySummary LatencyHistogram::summary() const noexcept {
  std::array<uint64_t, kBins> bins;
  uint64_t total = 0;
  for (size_t i = 0; i < kBins; ++i) total += bins[i] = bins_[i].load(std::memory_order_relaxed);
  if (total == 0) return {};

  const uint64_t max = max_.load(std::memory_order_relaxed);
  const auto percentile_us = [&](uint64_t percent) {
    const uint64_t rank = (total * percent + 99) / 100;
    uint64_t seen = 0;
    size_t bin = 0;
    while (bin + 1 < kBins && (seen += bins[bin]) < rank) ++bin;
    return static_cast<double>(std::min(upper_bound_of(bin), max)) / kNanosecondsPerMicrosecond;
  };
  return {.count = total,
          .p50_us = percentile_us(50),
          .p99_us = percentile_us(99),
          .max_us = static_cast<double>(max) / kNanosecondsPerMicrosecond};
}

namespace {

using nlohmann::ordered_json;

ordered_json latency_json(const LatencySummary& latency) {
  return {{"count", latency.count},
          {"p50", latency.p50_us},
          {"p99", latency.p99_us},
          {"max", latency.max_us}};
}

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

void LivePaceCounts::publish(const PaceCounts& counts) noexcept {
  const auto values = std::bit_cast<std::array<uint64_t, kFields>>(counts);
  for (size_t i = 0; i < kFields; ++i) fields_[i].set(values[i]);
}

PaceCounts LivePaceCounts::read() const noexcept {
  std::array<uint64_t, kFields> values{};
  for (size_t i = 0; i < kFields; ++i) values[i] = fields_[i].get();
  return std::bit_cast<PaceCounts>(values);
}

void FrameCopierStatistics::sample_ready(uint64_t ready) noexcept {
  ready_min.set(ready_samples.get() == 0 ? ready : std::min(ready_min.get(), ready));
  ready_sum.add(ready);
  ready_samples.add();
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

namespace {

uint64_t missed_of(const PaceCounts& counts) noexcept {
  return counts.missed + counts.repeated_underrun + counts.dropped;
}

uint64_t left_out_of(const PaceCounts& counts) noexcept {
  return counts.dropped + counts.skipped_planned;
}

}  // namespace

void TurnLog::count(ItemTurn& turn, const PaceCounts& counts) const noexcept {
  turn.missed = missed_of(counts) - missed_of(at_begin_);
  turn.left_out = left_out_of(counts) - left_out_of(at_begin_);
}

void TurnLog::flipped(const Flip& flip, const PaceCounts& counts) noexcept {
  const auto time_ns = static_cast<uint64_t>(flip.time.count());
  const bool begins = turn_.turn == 0 || flip.item != turn_.item;
  if (begins) {
    end(time_ns, counts, flip.cut != cut_);
    turn_ = {.turn = ++turns_, .item = flip.item, .begun_ns = time_ns};
    at_begin_ = counts;
  } else if (flip.number < last_number_) {
    ++turn_.rounds;
  }
  cut_ = flip.cut;
  last_number_ = flip.number;
  ++turn_.frames;
  turn_.ended_ns = time_ns;
  count(turn_, counts);
  running_.publish(turn_);
  if (begins) changed_.signal();
}

void TurnLog::finish(display::Nanoseconds time, const PaceCounts& counts) noexcept {
  end(static_cast<uint64_t>(time.count()), counts, true);
  turn_ = {};
  running_.publish(turn_);
  changed_.signal();
}

void TurnLog::end(uint64_t time_ns, const PaceCounts& counts, bool cut) noexcept {
  if (turn_.turn == 0) return;
  count(turn_, counts);
  turn_.ended_ns = time_ns;
  turn_.cut = cut ? 1 : 0;
  const uint64_t ended = ended_count_.load(std::memory_order_relaxed);
  ended_[ended % kKept].publish(turn_);
  ended_count_.store(ended + 1, std::memory_order_release);
}

std::optional<ItemTurn> TurnLog::take() noexcept {
  changed_.drain();
  while (true) {
    const uint64_t ended = ended_count_.load(std::memory_order_acquire);
    if (taken_ == ended) return std::nullopt;
    if (ended - taken_ > kKept) {
      lost_ += ended - kKept - taken_;
      taken_ = ended - kKept;
    }
    const ItemTurn turn = ended_[taken_ % kKept].read();
    ++taken_;
    if (turn.turn == taken_) return turn;
    ++lost_;  // overwritten meanwhile
  }
}

}  // namespace lenticule::player
