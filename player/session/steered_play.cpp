// SPDX-License-Identifier: Apache-2.0
#include "player/session/steered_play.h"

#include <unistd.h>

#include <csignal>
#include <filesystem>
#include <utility>

#include "base/error.h"
#include "base/print.h"

namespace lenticule::player {
namespace {

using nlohmann::ordered_json;

constexpr size_t kMaxComplaints = 1000;

bool folder_exists(const std::filesystem::path& file) {
  std::error_code error;
  return std::filesystem::is_directory(file.has_parent_path() ? file.parent_path() : ".", error);
}

/// Returns true if the source is a file that is shown again, which may be replaced meanwhile.
bool is_followed(const PlayPlan& plan) {
  return plan.playback.loops != 1 && !marks_of_source(plan.source).empty();
}

std::function<LeftItem(uint32_t)> left_item_of(const PlaybackControl& playback) {
  return [&playback](uint32_t number) { return playback.left_item(number); };
}

std::vector<WallPanel> panels_of(const std::vector<WallPart>& wall) {
  std::vector<WallPanel> panels;
  for (const WallPart& part : wall)
    panels.push_back({.name = part.name, .size = part.panel, .rig = part.rig});
  return panels;
}

/// Ends the process as Ctrl-C would; every wait of the player reacts to the signal.
void quit_in_good_order() {
  (void)::kill(::getpid(), SIGTERM);
}

}  // namespace

SteeredPlay::SteeredPlay(const PlayFlags& flags, const PlayPlan& plan)
    : flags_(flags), plan_(plan), is_list_(plan.source.kind == SourceKind::List) {
  if (is_list_ && plan.context.frames)
    throw Error(ErrorKind::Usage, "--frames: not allowed for a list",
                "write frames = \"A:B\" in its [[item]]");
  if (plan.trim) trim_version_ = plan.trim->version();
  if (flags.control.empty()) return;
  controls_ = std::make_unique<PlayControls>(PlayControlsOptions{
      .panel = plan.context.panel,
      .wall = panels_of(plan.context.wall),
      .read_playlist =
          [this](const std::string& text) {
            // The flags of the command line apply to its own source alone.
            const SourceSpec& own = plan_.source;
            const SourceSpec source = text == own.text ? own : parse_source(text);
            Playlist list = read_playlist(source, flags_, plan_);
            // Sources loaded over the control socket loop until the next command.
            const bool for_ever = flags_.loop.empty() && source.kind != SourceKind::List;
            if (for_ever) list.items.front().loops = kForever;
            return list;
          },
      .trim = plan.trim,
      .quit = quit_in_good_order});
  listen();
}

/// Opens the control socket. A full disk must not prevent playing, so a failure is retried.
void SteeredPlay::listen() {
  try {
    server_ = std::make_unique<ControlServer>(
        ControlServerOptions{.socket = flags_.control, .group = plan_.control_group}, *controls_);
    serving_.store(server_.get());
    listening_.succeeded();
  } catch (const Error& error) {
    const bool may_change = error.kind() == ErrorKind::Failed && folder_exists(flags_.control);
    const bool first = listening_.state().failures == 0;
    if (first && !may_change) throw;
    if (first) say("{}; playback continues, and the player tries again\n", error.what());
    listening_.failed(error.what());
  }
}

void SteeredPlay::detach_source() {
  if (controls_) controls_->steer(nullptr);
  source_ = nullptr;
}

void SteeredPlay::open(OpenedSource& opened) {
  detach_source();
  if (!is_list_ && !controls_ && !plan_.proof && !is_followed(plan_)) {
    opened = open_source(plan_.source, plan_.context);
    if (plan_.trim) plan_.trim->note_content(opened.woven_elsewhere);
    const bool still = opened.source->frame_count() == uint64_t{1};
    if (!still || !plan_.source.has_pictures()) return;
  } else {
    opened = {};
  }
  // A still picture is an item of a list, which knows how long it stays.
  const auto first = std::make_shared<OpenedSource>(std::exchange(opened, {}));
  auto source = std::make_unique<PlaylistSource>(
      std::make_shared<const Playlist>(read_playlist(plan_.source, flags_, plan_)),
      PlaylistSourceOptions{
          .panel = plan_.context.panel,
          .open =
              [first, open = item_opener(plan_)](const PlaylistItem& item, uint64_t frame) {
                return first->source ? std::exchange(*first, {}) : open(item, frame);
              },
          .rate = plan_.playback.content,
          .on_event = [this](const PlaylistEvent& event) { on_item(event); },
          .marks_of = [](const PlaylistItem& item) { return marks_of_source(item.source); },
          .read_list =
              [this](const std::string& name) {
                return read_playlist(parse_source(name), flags_, plan_);
              },
          .mark_list = [folders =
                            plan_.folders](const std::string& name) { return folders->mark(name); },
          .outlasts_faults = plan_.outlasts_faults,
          .left_item = controls_ ? left_item_of(controls_->playback()) : nullptr,
          .longest_wait = flags_.wait.empty() ? std::nullopt : plan_.playback.stall_timeout});
  source->open_first();
  source_ = source.get();
  opened.source = std::move(source);
  if (controls_) controls_->steer(source_);
}

void SteeredPlay::prepare(PlaybackOptions& options, frames::Rate refresh) {
  if (source_ == nullptr) return;
  source_->set_display_rate(refresh);
  options.loops = 1;  // the list counts the loops itself
  if (controls_) {
    options.control = &controls_->playback();
    source_->set_speed(controls_->playback().speed_permille() / 1000.0);
  }
  report_state("playing");
}

void SteeredPlay::report_state(const std::string& state) {
  if (controls_) controls_->report_state(state);
  if (std::exchange(state_, state) != state) publish({{"event", "state"}, {"state", state}});
}

void SteeredPlay::publish(ordered_json event) {
  if (ControlServer* const server = serving_.load()) server->publish(std::move(event));
}

/// Called on the list's threads.
void SteeredPlay::on_item(const PlaylistEvent& event) {
  using Kind = PlaylistEvent::Kind;
  if (plan_.trim && (event.kind == Kind::ItemStarted || event.kind == Kind::Returned))
    plan_.trim->note_content(event.woven_elsewhere);
  switch (event.kind) {
    case Kind::ItemStarted:
      return publish({{"event", "item_started"}, {"source", event.source}});
    case Kind::Returned:
      return publish({{"event", "returned"}, {"source", event.source}});
    case Kind::LoopPoint:
      return publish({{"event", "seam"}, {"source", event.source}});
    case Kind::Waiting:
      publish({{"event", "waiting"}, {"source", event.source}, {"cause", event.detail}});
      say("{}: {}\n", event.source, event.detail);
      return;
    case Kind::ItemDamaged:
      publish({{"event", "damaged_item"}, {"source", event.source}, {"cause", event.detail}});
      return complain("damaged", event);
    case Kind::ItemSkipped:
      publish({{"event", "bad_item"}, {"source", event.source}, {"cause", event.detail}});
      return complain("left out", event);
    case Kind::Kept:
      publish({{"event", "not_replaced"}, {"source", event.source}, {"cause", event.detail}});
      return complain("the previous one continues", event);
    case Kind::Replaced:
      say("{}: {}\n", event.source,
          event.detail.empty() ? "was replaced; the new version is played" : event.detail);
      return publish({{"event", "replaced"}, {"source", event.source}});
  }
}

void SteeredPlay::complain(const std::string& how, const PlaylistEvent& event) {
  const bool named = event.detail.starts_with(event.source);
  const std::string complaint = named ? event.detail : event.source + ": " + event.detail;
  // The number of damaged frames may differ from round to round, the item is reported once.
  const bool damaged = event.kind == PlaylistEvent::Kind::ItemDamaged;
  const std::lock_guard lock(reported_mutex_);
  if (reported_.size() < kMaxComplaints &&
      reported_.insert(damaged ? event.source : complaint).second)
    say("{}: {}\n", how, complaint);
}

void SteeredPlay::report(const PlayReport& report) {
  const auto now = std::chrono::steady_clock::now();
  if (controls_ && !server_ && listening_.due(now)) listen();
  (void)pace_.look(report, now);
  if (const auto warning = pace_.warning(now)) {
    say("{}\n", *warning);
    publish({{"event", "too_slow"}, {"figures", to_json(pace_.figures())}});
  }
  publish_changes(report);
}

void SteeredPlay::publish_changes(const PlayReport& report) {
  const uint64_t missed = report.pace.missed - before_.pace.missed;
  const uint64_t late = report.pace.repeated_underrun - before_.pace.repeated_underrun;
  if (report.off != before_.off)
    publish({{"event", "state"}, {"state", report.off ? "off" : state_}});
  if (missed + late > 0)
    publish({{"event", "frame_missed"}, {"missed_vblanks", missed}, {"late_frames", late}});
  if (plan_.trim && plan_.trim->version() != trim_version_) {
    trim_version_ = plan_.trim->version();
    const optics::Trim trim = plan_.trim->trim();
    publish({{"event", "trim_changed"},
             {"offset_lenses", trim.offset.value},
             {"pitch_relative", trim.pitch_relative}});
  }
  before_ = report;
}

void SteeredPlay::complete(ordered_json& statistics) {
  statistics["source_pace"] = to_json(pace_.figures());
  if (source_ != nullptr) {
    const PlaylistStatus status = source_->status();
    statistics["loops"] = status.loops;
    statistics["playlist"] = {{"list", status.list},
                              {"source", status.source},
                              {"items", status.items},
                              {"rounds_done", status.rounds_done},
                              {"items_started", status.started},
                              {"seams", status.loop_points},
                              {"items_skipped", status.skipped},
                              {"last_problem", status.last_problem},
                              {"waiting_for", status.waiting_for},
                              {"damaged_items", ordered_json::array()}};
    for (const auto& [source, damage] : status.damaged_items) {
      ordered_json item = {{"source", source}};
      item.update(to_json(damage));
      statistics["playlist"]["damaged_items"].push_back(std::move(item));
    }
  }
  if (server_) {
    const ControlCounts counts = server_->counts();
    statistics["control"] = {{"accepted", counts.accepted},
                             {"refused", counts.refused},
                             {"dropped", counts.dropped},
                             {"displaced", counts.displaced}};
  }
  if (controls_) controls_->report_statistics(statistics);
}

std::string SteeredPlay::failure() const {
  if (source_ == nullptr) return {};
  const PlaylistStatus status = source_->status();
  const bool nothing_played = status.started == 0;
  const bool only_one_broke = !is_list_ && status.started <= 1 && status.skipped > 0;
  if (!nothing_played && !only_one_broke) return {};
  if (is_list_ && !status.waiting_for.empty()) return status.list + ": " + status.waiting_for;
  return status.last_problem.empty() ? "none of its items could be played" : status.last_problem;
}

}  // namespace lenticule::player
