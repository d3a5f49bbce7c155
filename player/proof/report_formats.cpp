// SPDX-License-Identifier: Apache-2.0
#include "player/proof/report_formats.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <utility>
#include <vector>

#include "base/text.h"

namespace lenticule::player {
namespace {

using nlohmann::ordered_json;
using Cells = std::vector<std::string>;

/// Returns the number of characters of a text in UTF-8.
size_t width_of(const std::string& text) {
  return static_cast<size_t>(std::count_if(text.begin(), text.end(), [](char c) {
    return (static_cast<unsigned char>(c) & 0xc0) != 0x80;
  }));
}

constexpr size_t kFirstNumber = 2, kLastNumber = 7;  // these columns are aligned to the right

Cells heading() {
  return {"day",    "item",    "plays",     "whole", "interrupted", "frames",
          "missed", "damaged", "exactness", "panel", "unit"};
}

Cells cells_of(const ReportRow& row) {
  Cells cells = {row.day, escaped(row.item)};
  for (const uint64_t number :
       {row.plays(), row.whole, row.interrupted, row.frames, row.missed, row.damaged})
    cells.push_back(std::to_string(number));
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

std::string joined(const std::set<std::string>& texts) {
  std::string all;
  for (const std::string& text : texts) all += (all.empty() ? "" : " ") + text;
  return all;
}

ordered_json counts_of(const ReportRow& row) {
  return {{"plays", row.plays()},   {"whole", row.whole},        {"interrupted", row.interrupted},
          {"frames", row.frames},   {"unseen", row.unseen},      {"missed", row.missed},
          {"damaged", row.damaged}, {"exactness", row.exactness}};
}

}  // namespace

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
    std::vector<Cells> rows = {heading()};
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
      "day,item,hashes,plays,whole,interrupted,frames,unseen,missed,damaged,exactness,panel,unit\n";
  for (const ReportRow& row : summary.rows)
    text += fmt::format("{},{},{},{},{},{},{},{},{},{},{},{},{}\n", row.day, csv_cell(row.item),
                        csv_cell(joined(row.hashes)), row.plays(), row.whole, row.interrupted,
                        row.frames, row.unseen, row.missed, row.damaged, csv_cell(row.exactness),
                        csv_cell(row.panel), csv_cell(row.unit));
  return text;
}

}  // namespace lenticule::player
