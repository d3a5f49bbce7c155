// SPDX-License-Identifier: Apache-2.0
#include "player/preflight.h"

#include <algorithm>
#include <string>
#include <vector>

#include "base/error.h"
#include "base/print.h"
#include "display/open_display.h"
#include "player/command.h"
#include "player/interrupt.h"
#include "player/steered_play.h"

namespace lenticule::player {
namespace {

using nlohmann::ordered_json;

/// Of reading, for each item.
constexpr auto kLongest = std::chrono::seconds(5);
constexpr frames::Rate kStills{4, 1};

/// Without opening it: a panel's mode is not known yet, and is taken for the usual one.
frames::Rate refresh_of(const std::string& display) {
  return display::is_kms_spec(display) ? frames::Rate{60, 1}
                                       : display::parse_virtual_spec(display).refresh;
}

frames::Rate needed_rate(const PlaylistItem& item, const frames::FrameSource& source,
                         const PlayFlags& flags, const PlayPlan& plan) {
  if (plan.playback.content) return *plan.playback.content;
  if (item.rate) return *item.rate;
  const auto usual = source.frame_count() == uint64_t{1} ? kStills : refresh_of(flags.display);
  return source.rate().value_or(usual);
}

ordered_json examine(const PlaylistItem& item, const PlayFlags& flags, const PlayPlan& plan) {
  ordered_json row = {{"source", item.source}};
  if (item.source.starts_with("ring:")) {
    row["figures"] = nullptr;  // it comes from a renderer, which sends when it likes
    return row;
  }
  OpenedSource opened = item_opener(plan.source)(item, 0);
  const frames::Rate rate = needed_rate(item, *opened.source, flags, plan);
  row["figures"] = to_json(measure_source(*opened.source, rate, kLongest));
  return row;
}

void print_row(const ordered_json& row) {
  const auto& figures = row["figures"];
  const auto source = row["source"].get<std::string>();
  if (figures.is_null()) return print_out("{}: a ring is not read\n", source);
  print_out("{}: {}: needs {:.1f} frames/s ({:.0f} MB/s), {:.1f} frames/s ({:.0f} MB/s) came\n",
            source, figures["too_slow"].get<bool>() ? "TOO SLOW" : "keeps up",
            figures["needed_frames_per_s"].get<double>(), figures["needed_mb_per_s"].get<double>(),
            figures["seen_frames_per_s"].get<double>(), figures["seen_mb_per_s"].get<double>());
}

}  // namespace

ExitCode run_preflight(const PlayFlags& flags, const PlayPlan& plan) {
  const Playlist list = read_playlist(flags.source, flags, plan);
  std::vector<PlaylistItem> items = list.items;
  if (list.standby) items.push_back(*list.standby);
  ordered_json rows = ordered_json::array();
  for (const PlaylistItem& item : items) {
    if (interrupted()) return interrupt_exit_code();
    rows.push_back(examine(item, flags, plan));
    if (!flags.json) print_row(rows.back());
  }
  const bool too_slow = std::any_of(rows.begin(), rows.end(), [](const ordered_json& row) {
    return !row["figures"].is_null() && row["figures"]["too_slow"].get<bool>();
  });
  if (flags.json) print_out("{}\n", Verbatim{json_text(rows, 2)});
  return too_slow ? kQuality : kOk;
}

}  // namespace lenticule::player
