// SPDX-License-Identifier: Apache-2.0
#include "player/proof/proof_report.h"

#include <fmt/format.h>
#include <fnmatch.h>

#include <algorithm>
#include <array>
#include <ctime>
#include <utility>

#include "base/numbers.h"

namespace lenticule::player {
namespace {

constexpr int64_t kMicroseconds = 1'000'000;

std::tm local(int64_t time_us) {
  const auto seconds = static_cast<std::time_t>(time_us / kMicroseconds);
  std::tm time{};
  localtime_r(&seconds, &time);
  return time;
}

std::string formatted(int64_t time_us, const char* format) {
  const std::tm time = local(time_us);
  std::array<char, 128> text{};
  return {text.data(), std::strftime(text.data(), text.size(), format, &time)};
}

void add(const ProofEntry& entry, ReportRow& row) {
  if (!entry.hash.empty()) row.hashes.insert(entry.hash);
  row.exactness = worse_exactness(row.exactness, entry.exactness);
  row.whole += entry.whole;
  row.interrupted += entry.interrupted;
  row.frames += entry.frames;
  row.unseen += entry.unseen;
  row.missed += entry.missed;
  row.damaged += entry.damaged;
}

void add(const ReportRow& row, ReportRow& total) {
  total.exactness = worse_exactness(total.exactness, row.exactness);
  total.whole += row.whole;
  total.interrupted += row.interrupted;
  total.frames += row.frames;
  total.unseen += row.unseen;
  total.missed += row.missed;
  total.damaged += row.damaged;
}

/// Returns the numbers of "2026-11-25" or "14:03:05", all with two digits, except the year.
std::optional<std::vector<int>> parts(std::string_view text, char separator) {
  std::vector<int> numbers;
  while (!text.empty()) {
    const std::string_view part = take_until(text, separator);
    const auto number = number_from<int>(part);
    const size_t digits = separator == '-' && numbers.empty() ? 4 : 2;
    if (!number || part.size() != digits || *number < 0) return std::nullopt;
    numbers.push_back(*number);
  }
  return numbers;
}

/// Returns the time; nothing if there is no such day or time of day.
std::optional<int64_t> time_of(const std::vector<int>& day, std::vector<int> clock) {
  if (day.size() != 3 || clock.size() > 3 || clock.size() == 1) return std::nullopt;
  clock.resize(3);
  if (clock[0] > 23 || clock[1] > 59 || clock[2] > 59) return std::nullopt;
  std::tm time{};
  time.tm_year = day[0] - 1900;
  time.tm_mon = day[1] - 1;
  time.tm_mday = day[2];
  time.tm_hour = clock[0];
  time.tm_min = clock[1];
  time.tm_sec = clock[2];
  time.tm_isdst = -1;
  const std::time_t seconds = std::mktime(&time);
  if (time.tm_mon != day[1] - 1 || time.tm_mday != day[2] || seconds <= 0) return std::nullopt;
  return static_cast<int64_t>(seconds) * kMicroseconds;
}

std::vector<int> day_of(int64_t time_us, int days_before) {
  std::tm time = local(time_us);
  time.tm_mday -= days_before;
  time.tm_hour = 12;  // exists on each day of each time zone
  time.tm_isdst = -1;
  (void)std::mktime(&time);
  return {time.tm_year + 1900, time.tm_mon + 1, time.tm_mday};
}

}  // namespace

std::string worse_exactness(const std::string& a, const std::string& b) {
  const auto rank = [](std::string_view verdict) {
    return verdict == "no" ? 3 : verdict == "cannot tell" ? 2 : verdict == "yes" ? 1 : 0;
  };
  return rank(a) >= rank(b) ? a : b;
}

std::string writer_of(const ProofOrigin& origin) {
  if (origin.unit.ends_with(".service") && !origin.unit.starts_with("user@")) return origin.unit;
  return fmt::format("user {}: {}", origin.user.empty() ? "unknown" : origin.user,
                     origin.program.empty() ? "unknown program" : origin.program);
}

std::string local_day(int64_t time_us) {
  return formatted(time_us, "%Y-%m-%d");
}

std::string local_time(int64_t time_us) {
  return formatted(time_us, "%Y-%m-%d %H:%M:%S %Z");
}

std::optional<int64_t> parse_local_time(std::string_view text, int64_t now_us) {
  if (text == "today") return time_of(day_of(now_us, 0), {});
  if (text == "yesterday") return time_of(day_of(now_us, 1), {});
  const auto day = parts(take_until(text, ' '), '-');
  const auto clock = parts(text, ':');
  if (!day || !clock) return std::nullopt;
  return time_of(*day, *clock);
}

ProofReport::ProofReport(ReportFilter filter) : filter_(std::move(filter)) {}

bool ProofReport::covers(int64_t time_us) const {
  return (!filter_.since_us || time_us >= *filter_.since_us) &&
         (!filter_.until_us || time_us < *filter_.until_us);
}

bool ProofReport::covers_item(const std::string& item) const {
  if (filter_.item.empty()) return true;
  const std::string file = item.substr(item.rfind('/') + 1);
  return fnmatch(filter_.item.c_str(), item.c_str(), 0) == 0 ||
         fnmatch(filter_.item.c_str(), file.c_str(), 0) == 0;
}

ReportRow& ProofReport::row_of(int64_t time_us, const ProofEntry& entry,
                               const ProofOrigin& origin) {
  const Key key{local_day(time_us), entry.item, entry.panel, writer_of(origin)};
  const auto& [day, item, panel, unit] = key;
  return rows_.try_emplace(key, ReportRow{.day = day, .item = item, .panel = panel, .unit = unit})
      .first->second;
}

void ProofReport::add(const JournalEntry& entry) {
  if (!entry.proof) {
    ++ignored_;
    return;
  }
  const ProofEntry& proof = *entry.proof;
  const Session session{.origin = entry.origin, .number = proof.session};
  last_turn_[session] = proof.turn;
  if (!covers_item(proof.item)) return;
  const Turn turn{session, proof.turn};
  if (proof.event == ProofEntry::Event::Ended)
    open_.erase(turn);
  else
    open_.insert_or_assign(turn, proof);
  const bool counts = proof.event != ProofEntry::Event::Started;
  if (counts && covers(proof.from_us))
    lenticule::player::add(proof, row_of(proof.from_us, proof, entry.origin));
}

ProofSummary ProofReport::finish(const IsRunning& is_running) {
  ProofSummary summary;
  for (const auto& [turn, last] : open_) {
    if (!covers(last.until_us)) continue;
    const auto& [session, number] = turn;
    // A turn that another one followed is over, even if its end is missing.
    const bool running = last_turn_.at(session) == number && is_running(last, session.origin);
    summary.unended.push_back({.item = last.item,
                               .panel = last.panel,
                               .unit = writer_of(session.origin),
                               .counted_until_us = last.until_us,
                               .running = running});
    if (running) continue;
    ReportRow& row = row_of(last.until_us, last, session.origin);
    ++row.interrupted;
    if (!last.hash.empty()) row.hashes.insert(last.hash);
    row.exactness = worse_exactness(row.exactness, last.exactness);
  }
  std::sort(summary.unended.begin(), summary.unended.end(), [](const auto& a, const auto& b) {
    return std::tie(a.counted_until_us, a.item) < std::tie(b.counted_until_us, b.item);
  });
  for (const auto& [key, row] : rows_) {
    lenticule::player::add(row, summary.total);
    summary.rows.push_back(row);
  }
  summary.ignored = ignored_;
  return summary;
}

}  // namespace lenticule::player
