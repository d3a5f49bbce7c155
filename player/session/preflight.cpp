// SPDX-License-Identifier: Apache-2.0
// Implements lenticule play --preflight: tests whether disk and decoder are fast enough.
#include <fmt/ranges.h>

#include <algorithm>
#include <string>
#include <vector>

#include "base/error.h"
#include "base/print.h"
#include "display/open/open_display.h"
#include "player/playlist/playlist_reporter.h"
#include "player/playlist/source_pace.h"
#include "player/playlist/transition.h"
#include "player/process/interrupt.h"
#include "player/session/play_run.h"

namespace lenticule::player {
namespace {

using nlohmann::ordered_json;

/// Longest reading time for each item.
constexpr auto kLongest = std::chrono::seconds(5);
constexpr frames::Rate kStills{4, 1};

/// Returns the refresh rate without opening the display. A panel's mode is not known yet, so the
/// usual rate is assumed.
frames::Rate refresh_of(const std::string& display) {
  return display::is_kms_spec(display) ? frames::Rate{60, 1}
                                       : display::parse_virtual_spec(display).refresh;
}

frames::Rate needed_rate(const PlaylistItem& item, const frames::FrameSource& source,
                         const PlayPlan& plan) {
  if (plan.playback.content) return *plan.playback.content;
  if (item.rate) return *item.rate;
  const auto usual = source.frame_count() == uint64_t{1} ? kStills : refresh_of(plan.display.spec);
  return source.rate().value_or(usual);
}

/// Returns the row of a source without figures; `problem` may be empty.
ordered_json row_of(const std::string& source, const std::string& problem) {
  ordered_json row = {
      {"source", source}, {"figures", nullptr}, {"problems", ordered_json::array()}};
  if (!problem.empty()) row["problems"].push_back(problem);
  return row;
}

/// Measures whether this machine blends frames of a transition at the item's rate.
PaceFigures measure(Transition transition, frames::FrameGeometry panel, frames::Rate needed) {
  frames::WovenFrame frame(panel);
  for (size_t n = 0; n < frame.bytes().size(); ++n) frame.bytes()[n] = static_cast<uint8_t>(n / 7);
  const auto begin = std::chrono::steady_clock::now();
  for (uint64_t k = 0; k < Transition::kMostAcquired; ++k) {
    frames::FrameView next = frame.view();
    (void)transition.blend(frame.view(), k, Transition::kMostAcquired, next);
  }
  const std::chrono::duration<double> taken = std::chrono::steady_clock::now() - begin;
  return SourcePace::compare(needed, Transition::kMostAcquired / taken.count(), panel);
}

/// Adds the item's sound, or why it is not played.
void add_sound(ordered_json& row, const PlaylistItem& item, const PlayPlan& plan) try {
  if (const auto sound = find_sound(item, plan.sound->options()))
    row["sound"] = {{"file", sound->file},
                    {"codec", sound->stream.codec},
                    {"duration_s", sound->stream.duration_s.value_or(0.0)}};
} catch (const Error& error) {
  row["problems"].push_back(with_remedy(error));
}

ordered_json examine(const PlaylistItem& item, const Playlist& list, const PlayPlan& plan) {
  ordered_json row = row_of(item.source.text, {});
  const OverlaySet overlays(item.overlays, plan.context.pictures(), [&row](const Error& error) {
    row["problems"].push_back(with_remedy(error));
  });
  // A ring's renderer determines its own pace.
  if (item.source.kind == SourceKind::Ring) return row;
  try {
    OpenedSource opened = item_opener(plan)(item, 0);
    if (opened.live) {  // the camera determines its own pace
      row["live"] = {{"device", opened.live->device}, {"offers", capture_offers(item.source.text)}};
      return row;
    }
    const frames::FrameGeometry size = opened.source->geometry();
    if (size != plan.context.panel)
      row["problems"].push_back(fmt::format("frames of {}x{} pixels, but the panel has {}x{}",
                                            size.width, size.height, plan.context.panel.width,
                                            plan.context.panel.height));
    const frames::Rate rate = needed_rate(item, *opened.source, plan);
    if (list.transition_to(item) != TransitionKind::Cut) {
      const bool is_still = opened.source->frame_count() == uint64_t{1};
      row["transition"] = to_json(
          measure(Transition(list, item, plan.context.panel), plan.context.panel,
                  is_still && !plan.playback.content ? refresh_of(plan.display.spec) : rate));
    }
    try {
      row["figures"] = to_json(SourcePace::measure(*opened.source, rate, kLongest));
    } catch (const Error& error) {
      row["problems"].push_back(with_remedy(error));
    }
    add_sound(row, item, plan);
    if (const auto count = opened.source->frame_count(); count && row.contains("sound"))
      row["sound"]["film_s"] = static_cast<double>(*count) / rate.hertz();
    const frames::FrameDamage damage = opened.source->damage();
    row.update(to_json(damage));
    if (damage.any()) row["problems"].push_back(damage_text(damage));
  } catch (const Error& error) {
    row["problems"].push_back(with_remedy(error));
  }
  return row;
}

void print_row(const ordered_json& row) {
  const auto source = row["source"].get<std::string>();
  for (const auto& problem : row["problems"]) {
    const auto text = problem.get<std::string>();
    print_out("{}\n", text.starts_with(source) ? text : source + ": " + text);
  }
  const auto print_figures = [](const std::string& name, const ordered_json& figures) {
    print_out(
        "{}: {}: needs {:.1f} frames/s ({:.0f} MB/s), measured {:.1f} frames/s ({:.0f} MB/s)\n",
        name, figures["too_slow"].get<bool>() ? "TOO SLOW" : "keeps up",
        figures["needed_frames_per_s"].get<double>(), figures["needed_mb_per_s"].get<double>(),
        figures["seen_frames_per_s"].get<double>(), figures["seen_mb_per_s"].get<double>());
  };
  if (row.contains("transition")) print_figures(source + ": transition", row["transition"]);
  if (!row["figures"].is_null())
    print_figures(source, row["figures"]);
  else if (row.contains("live"))
    print_out("{}: {}\n", source, row["live"]["device"].get<std::string>());
  else if (row["problems"].empty() && !row.contains("sound"))
    print_out("{}: a ring is not checked\n", source);
  if (row.contains("live"))
    for (const auto& offer : row["live"]["offers"])
      print_out("  {} {}: {}\n", offer["device"].get<std::string>(),
                offer["format"].get<std::string>(),
                fmt::format("{}", fmt::join(offer["sizes"].get<std::vector<std::string>>(), ", ")));
  if (row.contains("sound")) print_out("{}: sound: {}\n", source, json_text(row["sound"]));
}

}  // namespace

ExitCode run_preflight(const PlayFlags& flags, const PlayPlan& plan) {
  const Playlist list = read_playlist(plan.source, flags, plan);
  std::vector<PlaylistItem> items = list.items;
  if (list.standby) items.push_back(*list.standby);
  ordered_json rows = ordered_json::array();
  const auto add = [&](const ordered_json& row) {
    rows.push_back(row);
    if (!flags.json) print_row(row);
  };
  for (const PlaylistItem& item : items) {
    if (interrupted()) return interrupt_exit_code();
    add(examine(item, list, plan));
  }
  if (!list.bed.file.empty()) {
    ordered_json row = row_of(list.bed.file, {});
    add_sound(row, {.sound = list.bed.file}, plan);
    add(row);
  }
  for (const std::string& file : plan.folders->unfinished_files())
    add(row_of(file, "is empty or still being written, and is not played until it is complete"));
  if (rows.empty()) add(row_of(list.name, "no file to play"));
  const bool too_slow = std::any_of(rows.begin(), rows.end(), [](const ordered_json& row) {
    const auto is_slow = [&row](const char* key) {
      return row.contains(key) && row[key].is_object() && row[key]["too_slow"].get<bool>();
    };
    return is_slow("figures") || is_slow("transition");
  });
  const bool bad = std::any_of(rows.begin(), rows.end(),
                               [](const ordered_json& row) { return !row["problems"].empty(); });
  if (flags.json) print_out("{}\n", Verbatim{json_text(rows, 2)});
  if (bad) return kInput;
  return too_slow ? kQuality : kOk;
}

}  // namespace lenticule::player
