// SPDX-License-Identifier: Apache-2.0
#include "player/proof/proof_report.h"

#include <fmt/format.h>
#include <fmt/ranges.h>
#include <grp.h>
#include <systemd/sd-id128.h>
#include <systemd/sd-journal.h>
#include <unistd.h>

#include <array>
#include <cstring>
#include <ctime>
#include <memory>

#include "base/error_kinds.h"
#include "base/numbers.h"
#include "base/text.h"

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

/// Returns the time; the day may be beyond its month.
int64_t time_of(std::tm time) {
  time.tm_isdst = -1;
  return static_cast<int64_t>(std::mktime(&time)) * kMicroseconds;
}

using nlohmann::ordered_json;
using Cells = std::vector<std::string>;

/// Returns the number of characters of a text in UTF-8.
size_t width_of(const std::string& text) {
  return static_cast<size_t>(std::ranges::count_if(
      text, [](char c) { return (static_cast<unsigned char>(c) & 0xc0) != 0x80; }));
}

constexpr size_t kFirstNumber = 2, kLastNumber = 9;  // these columns are aligned to the right

std::string seconds_text(const ReportRow& row, uint64_t ms) {
  return row.has_sound() ? fmt::format("{:.1f}", static_cast<double>(ms) / 1e3) : "";
}

Cells cells_of(const ReportRow& row) {
  Cells cells = {row.day, escaped(row.item)};
  for (const uint64_t number :
       {row.plays(), row.whole, row.interrupted, row.frames, row.missed, row.damaged})
    cells.push_back(std::to_string(number));
  for (const uint64_t ms : {row.heard_ms, row.silent_ms}) cells.push_back(seconds_text(row, ms));
  for (const std::string& text : {row.exactness, row.panel, row.unit})
    cells.push_back(escaped(text));
  return cells;
}

std::string table_of(const std::vector<Cells>& rows) {
  std::vector<size_t> widths(rows.front().size());
  for (const Cells& cells : rows)
    for (size_t k = 0; k < cells.size(); ++k) widths[k] = std::max(widths[k], width_of(cells[k]));
  std::string text;
  for (const Cells& cells : rows) {
    std::string line;
    for (size_t k = 0; k < cells.size(); ++k) {
      const std::string blanks(widths[k] - width_of(cells[k]), ' ');
      const bool is_number = k >= kFirstNumber && k <= kLastNumber;
      line += (k == 0 ? "" : "  ") + (is_number ? blanks + cells[k] : cells[k] + blanks);
    }
    line.erase(line.find_last_not_of(' ') + 1);
    text += line + '\n';
  }
  return text;
}

std::string note_of(const UnendedTurn& turn) {
  const std::string time = local_time(turn.counted_until_us);
  const std::string item = escaped(turn.item), unit = escaped(turn.unit);
  if (turn.running) return fmt::format("playing: {} ({}), counted until {}\n", item, unit, time);
  return fmt::format(
      "interrupted: {} ({}): the player or the machine stopped after {}; later frames are not "
      "counted\n",
      item, unit, time);
}

std::string csv_cell(const std::string& value) {
  std::string text = escaped(value);
  if (!text.empty() && std::string_view("=+-@").find(text.front()) != std::string_view::npos &&
      text != kNoExactness)
    text.insert(0, 1, '\'');
  if (text.find_first_of(",\"") == std::string::npos) return text;
  std::string quoted = "\"";
  for (const char c : text) quoted += c == '"' ? std::string("\"\"") : std::string(1, c);
  return quoted + '"';
}

ordered_json counts_of(const ReportRow& row) {
  ordered_json json = {{"plays", row.plays()},           {"whole", row.whole},
                       {"interrupted", row.interrupted}, {"frames", row.frames},
                       {"unseen", row.unseen},           {"missed", row.missed},
                       {"damaged", row.damaged},         {"exactness", row.exactness}};
  if (row.has_sound())
    json["sound"] = {{"heard_s", static_cast<double>(row.heard_ms) / 1e3},
                     {"silent_s", static_cast<double>(row.silent_ms) / 1e3},
                     {"devices", row.sound_devices}};
  return json;
}

using Journal = std::unique_ptr<sd_journal, decltype(&sd_journal_close)>;

constexpr size_t kMostFieldBytes = size_t{1} << 16;

void check(int result, const std::string& what) {
  if (result >= 0) return;
  throw input_error("{}: {}", what, std::strerror(-result))
      .remedy("name a folder of journal files, such as /var/log/journal/MACHINE");
}

Journal open_journal(const JournalPlace& place) {
  sd_journal* journal = nullptr;
  if (!place.files.empty()) {
    std::vector<const char*> names;
    for (const std::string& file : place.files) names.push_back(file.c_str());
    names.push_back(nullptr);
    check(sd_journal_open_files(&journal, names.data(), 0), place.files.front());
  } else if (!place.folder.empty()) {
    check(sd_journal_open_directory(&journal, place.folder.c_str(), 0), place.folder);
  } else {
    check(sd_journal_open(&journal, SD_JOURNAL_LOCAL_ONLY), "the journal of this machine");
  }
  return {journal, &sd_journal_close};
}

void select_entries(sd_journal* journal, const JournalPlace& place) {
  const auto match = [&](const std::string& field) {
    check(sd_journal_add_match(journal, field.data(), field.size()), field);
  };
  match(std::string("MESSAGE_ID=") + kProofMessageId);
  if (!place.unit.empty())
    match("_SYSTEMD_UNIT=" + place.unit +
          (place.unit.find('.') == std::string::npos ? ".service" : ""));
  check(sd_journal_set_data_threshold(journal, kMostFieldBytes), "the journal");
  if (place.since_us)
    check(sd_journal_seek_realtime_usec(journal, static_cast<uint64_t>(*place.since_us)),
          "the journal");
}

/// Returns the field "NAME=value" of the present entry; empty if it is missing.
std::string field_of(sd_journal* journal, const char* name) {
  const void* data = nullptr;
  size_t bytes = 0;
  if (sd_journal_get_data(journal, name, &data, &bytes) < 0) return {};
  return {static_cast<const char*>(data), bytes};
}

std::string value_of(sd_journal* journal, const char* name) {
  const std::string field = field_of(journal, name);
  return field.substr(std::min(field.size(), std::strlen(name) + 1));
}

ProofOrigin origin_of(sd_journal* journal) {
  return {.unit = value_of(journal, "_SYSTEMD_UNIT"),
          .user = value_of(journal, "_UID"),
          .program = value_of(journal, "_EXE"),
          .boot = value_of(journal, "_BOOT_ID"),
          .process = number_from<int64_t>(value_of(journal, "_PID")).value_or(0)};
}

JournalEntry entry_of(sd_journal* journal) {
  std::vector<std::string> fields;
  for (const char* const name : proof_field_names()) fields.push_back(field_of(journal, name));
  const std::vector<std::string_view> views(fields.begin(), fields.end());
  return {.proof = parse_proof_entry(views), .origin = origin_of(journal)};
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

std::string local_day(int64_t time_us) { return formatted(time_us, "%Y-%m-%d"); }

std::string local_time(int64_t time_us) { return formatted(time_us, "%Y-%m-%d %H:%M:%S %Z"); }

std::optional<int64_t> parse_local_time(std::string_view text, int64_t now_us) {
  std::tm time = local(now_us);
  if (text == "today" || text == "yesterday")
    return time_of({.tm_mday = time.tm_mday - (text == "today" ? 0 : 1),
                    .tm_mon = time.tm_mon,
                    .tm_year = time.tm_year});
  const std::string whole(text);
  for (const std::string_view format : {"%Y-%m-%d", "%Y-%m-%d %H:%M", "%Y-%m-%d %H:%M:%S"}) {
    time = {};
    const char* const end = strptime(whole.c_str(), format.data(), &time);
    if (end == nullptr || *end != '\0') continue;
    // Digits must not be missing, and the day must exist; a time of day may not, in spring.
    const int64_t time_us = time_of(time);
    const bool is_whole = text.size() == formatted(time_us, format.data()).size();
    if (time_us > 0 && is_whole && text.starts_with(local_day(time_us))) return time_us;
  }
  return std::nullopt;
}

ordered_json to_json(const ProofSummary& summary) {
  ordered_json json = {{"rows", ordered_json::array()},
                       {"total", counts_of(summary.total)},
                       {"playing", ordered_json::array()},
                       {"without_end", ordered_json::array()},
                       {"ignored_entries", summary.ignored}};
  for (const ReportRow& row : summary.rows) {
    ordered_json one = {{"day", row.day}, {"item", row.item}, {"hashes", row.hashes}};
    one.update(counts_of(row));
    one["panel"] = row.panel;
    one["unit"] = row.unit;
    json["rows"].push_back(std::move(one));
  }
  for (const UnendedTurn& turn : summary.unended)
    json[turn.running ? "playing" : "without_end"].push_back(
        {{"item", turn.item},
         {"panel", turn.panel},
         {"unit", turn.unit},
         {"counted_until", local_time(turn.counted_until_us)},
         {"counted_until_usec", turn.counted_until_us}});
  return json;
}

std::string table_text(const ProofSummary& summary) {
  if (summary.rows.empty() && summary.unended.empty() && summary.ignored == 0)
    return "no plays are recorded for this time\n";
  std::string text;
  if (!summary.rows.empty()) {
    std::vector<Cells> rows = {{"day", "item", "plays", "whole", "interrupted", "frames", "missed",
                                "damaged", "heard s", "silent s", "exactness", "panel", "unit"}};
    for (const ReportRow& row : summary.rows) rows.push_back(cells_of(row));
    ReportRow total = summary.total;
    total.day = "total";
    rows.push_back(cells_of(total));
    text = table_of(rows);
  }
  for (const UnendedTurn& turn : summary.unended) text += note_of(turn);
  if (summary.total.unseen > 0)
    text += fmt::format("unseen: {} more frames were sent while no panel displayed them\n",
                        summary.total.unseen);
  if (summary.ignored > 0)
    text += fmt::format("ignored: {} entries with missing or wrong fields\n", summary.ignored);
  return text;
}

std::string csv_text(const ProofSummary& summary) {
  std::string text =
      "day,item,hashes,plays,whole,interrupted,frames,unseen,missed,damaged,exactness,panel,unit,"
      "heard_s,silent_s,sound_devices\n";
  for (const ReportRow& row : summary.rows)
    text +=
        fmt::format("{},{},{},{},{},{},{},{},{},{},{},{},{},{},{},{}\n", row.day,
                    csv_cell(row.item), csv_cell(fmt::format("{}", fmt::join(row.hashes, " "))),
                    row.plays(), row.whole, row.interrupted, row.frames, row.unseen, row.missed,
                    row.damaged, csv_cell(row.exactness), csv_cell(row.panel), csv_cell(row.unit),
                    seconds_text(row, row.heard_ms), seconds_text(row, row.silent_ms),
                    csv_cell(fmt::format("{}", fmt::join(row.sound_devices, " "))));
  return text;
}

void read_proof(const JournalPlace& place, const std::function<void(const JournalEntry&)>& take) {
  const Journal journal = open_journal(place);
  select_entries(journal.get(), place);
  while (true) {
    const int more = sd_journal_next(journal.get());
    check(more, "the journal");
    if (more == 0) return;
    take(entry_of(journal.get()));
  }
}

bool is_running(const ProofEntry& entry, const ProofOrigin& origin) {
  sd_id128_t boot{};
  std::array<char, SD_ID128_STRING_MAX> text{};
  if (sd_id128_get_boot(&boot) < 0 || origin.boot != sd_id128_to_string(boot, text.data()))
    return false;
  return entry.process_start != 0 && process_start_of(origin.process) == entry.process_start;
}

bool may_read_system_journal() {
  if (::geteuid() == 0) return true;
  std::array<gid_t, 256> groups{};
  const int count = ::getgroups(static_cast<int>(groups.size()), groups.data());
  for (const char* const name : {"systemd-journal", "adm"}) {
    const group* const known = ::getgrnam(name);
    if (known != nullptr && count > 0 &&
        std::find(groups.begin(), groups.begin() + count, known->gr_gid) != groups.begin() + count)
      return true;
  }
  return false;
}

}  // namespace lenticule::player
