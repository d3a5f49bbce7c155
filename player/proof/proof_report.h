// SPDX-License-Identifier: Apache-2.0
// ProofReport sums the entries of the proof of play by day and item. It reads no clock and no file,
// except the machine's time zone. The functions below it read entries from a journal and format the
// report for people, spreadsheets and programs.
#pragma once

#include <fnmatch.h>

#include <algorithm>
#include <cstdint>
#include <functional>
#include <map>
#include <nlohmann/json.hpp>
#include <optional>
#include <set>
#include <string>
#include <string_view>
#include <tuple>
#include <utility>
#include <vector>

#include "player/proof/proof_entry.h"

namespace lenticule::player {

/// ProofOrigin is what the journal itself states about the writer of an entry, who cannot forge it.
/// Texts are empty where the journal does not know.
struct ProofOrigin {
  std::string unit{};  ///< "lenticule-player@lobby.service"
  std::string user{};  ///< number of the user
  std::string program{};
  std::string boot{};  ///< the machine's start
  int64_t process = 0;
  friend auto operator<=>(const ProofOrigin&, const ProofOrigin&) = default;
};

struct JournalEntry {
  std::optional<ProofEntry> proof{};  ///< none: fields are missing or wrong
  ProofOrigin origin{};
};

struct ReportFilter {
  std::optional<int64_t> since_us{};
  std::optional<int64_t> until_us{};  ///< exclusive
  std::string item{};                 ///< glob for the item or its file name; empty = all
};

/// ReportRow is one item on one day, on one panel, as recorded by one unit.
struct ReportRow {
  std::string day;  ///< "2026-11-25", local time
  std::string item;
  std::string panel;
  std::string unit;  ///< see writer_of()
  std::set<std::string> hashes{};
  std::string exactness = kNoExactness;  ///< the worst
  uint64_t whole = 0, interrupted = 0;   ///< plays
  uint64_t frames = 0, unseen = 0, missed = 0, damaged = 0;
  uint64_t heard_ms = 0, silent_ms = 0;
  std::set<std::string> sound_devices{};
  [[nodiscard]] uint64_t plays() const { return whole + interrupted; }
  [[nodiscard]] bool has_sound() const { return heard_ms + silent_ms > 0; }
};

/// UnendedTurn is a turn without an end.
struct UnendedTurn {
  std::string item;
  std::string panel;
  std::string unit;
  int64_t counted_until_us = 0;  ///< time of the last entry; later frames are not counted
  bool running = false;          ///< its player still runs; else the player or the machine ended
};

struct ProofSummary {
  std::vector<ReportRow> rows;  ///< one for each day, item, panel and unit, in this order
  ReportRow total;
  std::vector<UnendedTurn> unended;
  uint64_t ignored = 0;  ///< entries with missing or wrong fields
};

/// Returns the worse of two verdicts of exactness: "no", "cannot tell", "yes", "-".
[[nodiscard]] std::string worse_exactness(const std::string& a, const std::string& b);
/// Returns the writer's unit, or "user 1000: /usr/bin/lenticule" if it is not in a service.
[[nodiscard]] std::string writer_of(const ProofOrigin& origin);
/// Returns the local day, "2026-11-25", and the local time with its zone, "2026-11-25 14:03:05
/// CET".
[[nodiscard]] std::string local_day(int64_t time_us);
[[nodiscard]] std::string local_time(int64_t time_us);

class ProofReport {
 public:
  using IsRunning = std::function<bool(const ProofEntry&, const ProofOrigin&)>;

  explicit ProofReport(ReportFilter filter) : filter_(std::move(filter)) {}
  /// Adds an entry; entries of one player come in the order in which it wrote them.
  void add(const JournalEntry& entry) {
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
    if (!counts || !covers(proof.from_us)) return;
    ReportRow& row = row_of(proof.from_us, proof, entry.origin);
    if (!proof.hash.empty()) row.hashes.insert(proof.hash);
    if (!proof.sound_device.empty()) row.sound_devices.insert(proof.sound_device);
    add_counts(proof, row);
  }
  /// Returns the sums. A turn without an end counts as an interrupted play, unless its player runs.
  [[nodiscard]] ProofSummary finish(const IsRunning& is_running) {
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
      add_counts(row, summary.total);
      summary.rows.push_back(row);
    }
    summary.ignored = ignored_;
    return summary;
  }

 private:
  /// Adds the counts of an entry or of a row.
  template <class Counts>
  static void add_counts(const Counts& counts, ReportRow& row) {
    row.exactness = worse_exactness(row.exactness, counts.exactness);
    row.whole += counts.whole;
    row.interrupted += counts.interrupted;
    row.frames += counts.frames;
    row.unseen += counts.unseen;
    row.missed += counts.missed;
    row.damaged += counts.damaged;
    row.heard_ms += counts.heard_ms;
    row.silent_ms += counts.silent_ms;
  }
  struct Session {
    ProofOrigin origin;
    std::string number;
    friend auto operator<=>(const Session&, const Session&) = default;
  };
  using Turn = std::pair<Session, uint64_t>;
  using Key = std::tuple<std::string, std::string, std::string, std::string>;
  [[nodiscard]] bool covers(int64_t time_us) const {
    return (!filter_.since_us || time_us >= *filter_.since_us) &&
           (!filter_.until_us || time_us < *filter_.until_us);
  }
  [[nodiscard]] bool covers_item(const std::string& item) const {
    if (filter_.item.empty()) return true;
    const std::string file = item.substr(item.rfind('/') + 1);
    return fnmatch(filter_.item.c_str(), item.c_str(), 0) == 0 ||
           fnmatch(filter_.item.c_str(), file.c_str(), 0) == 0;
  }
  [[nodiscard]] ReportRow& row_of(int64_t time_us, const ProofEntry& entry,
                                  const ProofOrigin& origin) {
    const Key key{local_day(time_us), entry.item, entry.panel, writer_of(origin)};
    const auto& [day, item, panel, unit] = key;
    return rows_.try_emplace(key, ReportRow{.day = day, .item = item, .panel = panel, .unit = unit})
        .first->second;
  }

  const ReportFilter filter_;
  std::map<Key, ReportRow> rows_;
  std::map<Turn, ProofEntry> open_;        ///< last entry of each turn without an end
  std::map<Session, uint64_t> last_turn_;  ///< newest turn of which an entry was added
  uint64_t ignored_ = 0;
};

/// Parses "2026-11-25", "2026-11-25 14:03", "2026-11-25 14:03:05", "today" or "yesterday" as local
/// time, in microseconds. Returns nothing for other texts.
[[nodiscard]] std::optional<int64_t> parse_local_time(std::string_view text, int64_t now_us);

[[nodiscard]] nlohmann::ordered_json to_json(const ProofSummary& summary);
/// Returns a table with totals, and a line about each fact that the table does not show.
[[nodiscard]] std::string table_text(const ProofSummary& summary);
/// Returns lines of comma-separated values with a header, after RFC 4180. A text that a spreadsheet
/// would take for a formula begins with an apostrophe.
[[nodiscard]] std::string csv_text(const ProofSummary& summary);

struct JournalPlace {
  std::string folder{};              ///< folder of journal files; empty = the machine's journal
  std::vector<std::string> files{};  ///< journal files, in place of a folder
  std::string unit{};                ///< only entries of this unit; empty = all
  std::optional<int64_t> since_us{};
};

/// Calls `take` for each entry with the MESSAGE_ID of the proof of play, oldest first. Throws
/// Error(Input) for a journal that cannot be read.
void read_proof(const JournalPlace& place, const std::function<void(const JournalEntry&)>& take);

/// Returns true if the process that wrote the entry is still there: same machine start, same
/// process.
[[nodiscard]] bool is_running(const ProofEntry& entry, const ProofOrigin& origin);

/// Returns true if this user may read the entries of other users and of services.
[[nodiscard]] bool may_read_system_journal();

}  // namespace lenticule::player
