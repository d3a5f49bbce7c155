// SPDX-License-Identifier: Apache-2.0
// SteeredPlay adds playlists and a control socket to a run of `lenticule play`.
#pragma once

#include <fmt/format.h>
#include <fmt/ranges.h>
#include <unistd.h>

#include <algorithm>
#include <atomic>
#include <condition_variable>
#include <csignal>
#include <deque>
#include <filesystem>
#include <functional>
#include <memory>
#include <mutex>
#include <nlohmann/json.hpp>
#include <optional>
#include <set>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include "base/error_kinds.h"
#include "base/print.h"
#include "frames/image_io.h"
#include "frames/weave.h"
#include "optics/rig_file.h"
#include "player/control/control_answers.h"
#include "player/control/control_server.h"
#include "player/playlist/playlist_source.h"
#include "player/playlist/source_pace.h"
#include "player/process/interrupt.h"
#include "player/session/play_plan.h"
#include "player/sources/live_rig.h"

namespace lenticule::player {

/// PlayControls carries out the requests that arrive on a running player's control socket.
/// Thread safety: handle() runs on the server's thread; all other functions on the player's main
/// thread.
class PlayControls final : public ControlTarget {
 public:
  /// Reads a list or a single source. Throws Error.
  using PlaylistReader = std::function<Playlist(const std::string& source)>;

  /// `read_playlist` reads what `load` names, on a thread of the object. Lifetime: `plan` must
  /// outlive the object.
  PlayControls(const PlayPlan& plan, PlaylistReader read_playlist)
      : plan_(plan),
        read_playlist_(std::move(read_playlist)),
        worker_([this](const std::stop_token& stop) { work(stop); }) {}

  void handle(const ControlRequest& request, ControlRights rights,
              std::function<void(ControlAnswer)> answer) override {
    const auto answer_later = [&](const std::function<ControlAnswer()>& work) {
      work_on(answer, [work](const Answer& done) { done(work()); });
    };
    const std::string_view verb = request.verb;
    if (verb == "status") return answer(status());
    if (verb == "stats") return answer(statistics());
    if (verb == "doctor") return answer(doctor());
    if (verb == "play" || verb == "pause") return answer(pause(verb == "pause"));
    if (verb == "next" || verb == "previous")
      return jump({.item = verb == "next" ? 1 : -1, .relative = true}, answer);
    if (verb == "seek") {
      Jump where{.frame = request.frame.value_or(0)};
      if (request.item) where.item = static_cast<int64_t>(*request.item);
      return jump(where, answer);
    }
    if (verb == "load") return load(request, answer);
    if (verb == "interrupt") return interrupt(request, answer);
    if (verb == "blank") return blank(answer);
    if (verb == "back") return back(answer);
    if (verb == "cue") return cue(request, answer);
    if (verb == "go") return go(answer);
    if (verb == "speed") return answer(set_speed(request.speed_permille));
    if (verb == "volume") {
      if (!plan_.sound) throw Error(ErrorKind::Failed, "volume: this player has no sound");
      plan_.sound->set_volume(request.volume_db);
      return answer(ordered_json{{"db", request.volume_db}});
    }
    if (verb == "overlay") return answer_later([this, request] { return show_over(request); });
    if (verb == "power") return answer_later([this, request] { return switch_output(request.on); });
    if (verb == "loop") return answer(set_loops(request.loops));
    if (verb == "trim") return answer_later([this, request] { return change_trim(request); });
    if (verb == "rig") return answer_later([this, request] { return replace_rig(request); });
    if (verb == "snapshot") {
      if (rights != ControlRights::Everything)
        throw Error(
            ErrorKind::Device,
            "snapshot: not permitted, because the file would be written as the player's user",
            "connect as the player's user, or as root");
      frames::check_writable_format(request.file);
      return answer_later([this, request] { return take_snapshot(request); });
    }
    if (verb == "frame") return answer_later([this] { return share_frame(); });
    if (verb == "list") return answer(list_json(*present_list(), request.item.value_or(0)));
    LENTICULE_CHECK(verb == "quit");  // the server itself handles 'subscribe'
    answer(ordered_json{{"quitting", true}});
    (void)::kill(::getpid(), SIGTERM);  // as Ctrl-C, to which every wait of the player reacts
  }

  /// Returns the object by which the playback is controlled.
  [[nodiscard]] PlaybackControl& playback() { return playback_; }
  /// Sets the playlist that is controlled from now on; null while there is none. Lifetime: `source`
  /// must stay valid until the next call.
  void steer(PlaylistSource* source) {
    const std::lock_guard lock(mutex_);
    source_ = source;
  }
  /// Stores the newest statistics, and the state of the run, for later requests.
  void report_statistics(const nlohmann::ordered_json& statistics) {
    const std::lock_guard lock(mutex_);
    statistics_ = statistics;
  }
  void report_state(const PlayState& run) {
    const std::lock_guard lock(mutex_);
    run_ = run;
  }
  /// Call it about once a second: ends an overlay whose time is over.
  void end_overlay() {
    const std::lock_guard lock(mutex_);
    if (source_ != nullptr && source_->end_overlay()) locked_show_again();
  }
  /// Returns the state of the player, whose run and list have these.
  [[nodiscard]] PlayState state_with(const PlayState& run, const PlayState& list) const {
    if (!run.plays()) return run;
    if (playback_.is_off()) return {"off", "until 'power on'"};
    if (playback_.paused()) return {"paused", "until 'play'"};
    return list.plays() && playback_.displayed().frames == 0 ? kStarting : list;
  }

 private:
  using ordered_json = nlohmann::ordered_json;
  static constexpr size_t kMaxTasks = 4;
  static constexpr auto kLongestSwitch = std::chrono::seconds(5);

  /// Returns the list in use; the caller holds the mutex. Throws Error(Failed) if there is none.
  [[nodiscard]] PlaylistSource& steered() const {
    if (source_ != nullptr) return *source_;
    throw Error(ErrorKind::Failed, "control: nothing is playing",
                "'status' says what the player is doing");
  }

  static ordered_json place_json(const PlaylistStatus& status) {
    return {{"list", status.list},
            {"source", status.source},
            {"item", or_null(status.item)},
            {"items", status.items}};
  }
  template <class Value>
  static ordered_json or_null(const std::optional<Value>& value) {
    return value ? ordered_json(*value) : ordered_json(nullptr);
  }

  /// Returns the index of the panel of a wall; none if the player shows one panel.
  static std::optional<size_t> part_for(const std::string& name,
                                        const std::vector<WallPart>& wall) {
    if (wall.empty() && name.empty()) return std::nullopt;
    if (wall.empty())
      throw Error(ErrorKind::Usage, "panel: this player shows one panel", "leave --panel out");
    const auto found = std::ranges::find(wall, name, &WallPart::name);
    if (found != wall.end()) return static_cast<size_t>(found - wall.begin());
    std::vector<std::string> names;
    for (const WallPart& panel : wall) names.push_back(panel.name);
    throw Error(ErrorKind::Usage,
                "panel: " + (name.empty() ? "none is named" : "no '" + name + "'"),
                fmt::format("this player shows {}", fmt::join(names, ", ")));
  }

  using Answer = std::function<void(ControlAnswer)>;

  /// Returns the frame displayed at this moment and the item being read; around a change the two
  /// differ for a few frames.
  [[nodiscard]] nlohmann::ordered_json status() const {
    const DisplayedPlace displayed = playback_.displayed();
    const std::lock_guard lock(mutex_);
    const PlaylistStatus status = source_ != nullptr ? source_->status() : PlaylistStatus();
    const PlayState state = state_with(run_, status.state);
    ordered_json json = {{"state", state.word},
                         {"reason", state.reason},
                         {"speed", playback_.speed_permille() / 1000.0},
                         {"frames_shown", displayed.frames},
                         {"log_lines_dropped", dropped_log_lines()}};
    json["displayed"] = nullptr;
    if (source_ != nullptr) {
      const auto play = static_cast<uint32_t>(displayed.item);
      if (displayed.frames > 0) {
        const ItemAccount item = source_->account_of(play).value_or(ItemAccount{});
        json["displayed"] = {{"source", item.source.text},
                             {"frame", displayed.number},
                             {"item", or_null(item.index)}};
      }
      json["reading"] = place_json(status);
      json["reading"]["frames"] = or_null(status.frames);
      json["rounds_done"] = status.rounds_done;
      json["opening"] = status.opening;
      for (const auto& [key, text] :
           {std::pair("cued", status.cued), std::pair("interrupted", status.interrupted)})
        json[key] = text.empty() ? ordered_json(nullptr) : ordered_json(text);
      json["items_skipped"] = status.skipped;
      json["last_problem"] = status.last_problem;
      json["overlays"] = status.overlays;
      if (status.live) json["live"] = to_json(*status.live);
      json.update(to_json(status.damage));
    }
    if (plan_.trim) json["trim"] = trim_json(plan_.trim->trim());
    if (plan_.sound) json["sound"] = plan_.sound->statistics();
    for (const char* key : {"write_problems", "rig_problem"})
      if (statistics_.contains(key)) json[key] = statistics_[key];
    return json;
  }
  [[nodiscard]] nlohmann::ordered_json statistics() const {
    const std::lock_guard lock(mutex_);
    return {{"statistics", statistics_}};
  }
  [[nodiscard]] nlohmann::ordered_json doctor() const {
    const std::lock_guard lock(mutex_);
    ordered_json json;
    for (const char* key :
         {"display", "exactness", "kms", "state", "reason", "source_pace", "sound"})
      json[key] = statistics_.contains(key) ? statistics_[key] : ordered_json(nullptr);
    return json;
  }
  [[nodiscard]] nlohmann::ordered_json pause(bool paused) {
    {
      const std::lock_guard lock(mutex_);
      if (source_ != nullptr) source_->hold(paused);
    }
    playback_.pause(paused);
    return {{"paused", paused}};
  }
  [[nodiscard]] nlohmann::ordered_json set_loops(uint64_t loops) {
    const std::lock_guard lock(mutex_);
    steered().set_loops(loops);
    return {{"count", loops_json(loops)}};
  }
  [[nodiscard]] nlohmann::ordered_json change_trim(const ControlRequest& request) {
    if (!plan_.trim) throw Error(ErrorKind::Failed, "trim: this player cannot change the trim");
    const optics::Trim now = plan_.trim->change([&](const optics::Trim& trim) {
      if (request.relative)
        return optics::changed_by(trim, request.offset_lenses.value_or(0.0),
                                  request.pitch_relative.value_or(0.0));
      return optics::Trim{.offset = Lenses(request.offset_lenses.value_or(trim.offset.value)),
                          .pitch_relative = request.pitch_relative.value_or(trim.pitch_relative)};
    });
    ordered_json json = trim_json(now);
    const std::string problem = plan_.trim->why_unsaved();
    json["saved"] = problem.empty();
    if (!problem.empty()) json["problem"] = problem;
    if (std::string advice = plan_.trim->advice(); !advice.empty())
      json["advice"] = std::move(advice);
    return json;
  }
  /// Replaces the player's own rig file by a new calibration of the same panel.
  [[nodiscard]] nlohmann::ordered_json replace_rig(const ControlRequest& request) {
    if (!plan_.trim) throw Error(ErrorKind::Failed, "rig: this player has no rig");
    const optics::Rig rig = optics::parse_rig(request.rig_toml, "rig");
    const std::filesystem::path kept = plan_.trim->replace_rig(rig);
    return {{"fingerprint", optics::fingerprint(rig)}, {"old_rig_kept_as", kept.string()}};
  }
  /// Jumps to another place. The answer is sent when its first frame is taken, or when the jump has
  /// failed.
  void jump(Jump where, const Answer& answer) {
    const std::lock_guard lock(mutex_);
    PlaylistSource& source = steered();
    where.displayed = source.account_of(static_cast<uint32_t>(playback_.displayed().item));
    source.jump(where, [answer, &source, frame = where.frame](const Error* error) {
      if (error != nullptr) return answer(*error);
      ordered_json json = place_json(source.status());
      json["frame"] = frame;
      answer(std::move(json));
    });
  }
  void load(const ControlRequest& request, const Answer& answer) {
    work_on(answer, [this, request](const Answer& done) {
      Jump where{.list = std::make_shared<const Playlist>(read_playlist_(request.source)),
                 .item = static_cast<int64_t>(request.item.value_or(0)),
                 .frame = request.frame.value_or(0)};
      jump(std::move(where), done);
    });
  }
  void interrupt(const ControlRequest& request, const Answer& answer) {
    work_on(answer, [this, request](const Answer& done) {
      jump({.list = interruption_of(request),
            .item = 0,
            .frame = request.frame.value_or(0),
            .interrupts = true},
           done);
    });
  }
  /// Shows a black frame until back().
  void blank(const Answer& answer) {
    jump({.list = std::make_shared<const Playlist>(playlist_of(parse_source("black"), kForever)),
          .item = 0,
          .interrupts = true},
         answer);
  }
  void back(const Answer& answer) {
    const std::lock_guard lock(mutex_);
    PlaylistSource& source = steered();
    if (source.status().interrupted.empty())
      return answer(ConflictAnswer{{ErrorKind::Failed, "back: nothing is interrupted",
                                    "'interrupt' and 'blank' begin an interruption"}});
    source.return_now([answer, &source](const Error* error) {
      if (error != nullptr) return answer(*error);
      answer(place_json(source.status()));
    });
  }
  void cue(const ControlRequest& request, const Answer& answer) {
    work_on(answer, [this, request](const Answer& done) {
      Jump where{.frame = request.frame.value_or(0), .interrupts = request.then_back};
      if (request.then_back)
        where.list = interruption_of(request);
      else if (!request.item)
        where.list = std::make_shared<const Playlist>(read_playlist_(request.source));
      where.item = request.item && !request.then_back ? static_cast<int64_t>(*request.item) : 0;
      const std::lock_guard lock(mutex_);
      PlaylistSource& source = steered();
      source.cue(where, [done, &source](const Error* error) {
        if (error != nullptr) return done(*error);
        done(ordered_json{{"cued", source.status().cued}});
      });
    });
  }
  /// Shows the cued item. A second request before its first frame is displayed changes nothing, as
  /// that of a button that bounces.
  void go(const Answer& answer) {
    const std::lock_guard lock(mutex_);
    PlaylistSource& source = steered();
    if (!playback_.time_next_cut()) return answer(ordered_json{{"already_going", true}});
    if (source.status().cued.empty()) {
      playback_.forget_next_cut();
      return answer(
          ConflictAnswer{{ErrorKind::Failed, "go: no item is cued", "cue one first: cue SOURCE"}});
    }
    source.go([this, answer, &source](const Error* error) {
      if (error == nullptr) return answer(place_json(source.status()));
      playback_.forget_next_cut();
      answer(*error);
    });
  }
  /// Returns the list that an interruption plays once.
  [[nodiscard]] std::shared_ptr<const Playlist> interruption_of(
      const ControlRequest& request) const {
    Playlist list;
    if (request.item) {
      const std::shared_ptr<const Playlist> playing = present_list();
      if (*request.item >= playing->items.size())
        throw Error(
            ErrorKind::Usage,
            fmt::format("item {}: the list has {} items", *request.item, playing->items.size()),
            "items are counted from 0");
      list = {.name = playing->name, .items = {playing->items[*request.item]}, .standby = {}};
    } else {
      list = read_playlist_(request.source);
      // A source is shown once, however often the player repeats its own; a list says how often.
      if (!list.file && list.items.size() == 1) list.items.front().loops = 1;
      list.file.reset();
      list.standby.reset();
      list.awaits_files = false;
    }
    list.rounds = 1;
    if (request.seconds && list.items.size() != 1)
      throw Error(ErrorKind::Usage, "seconds: only for a single source or item",
                  "write duration_s into the list");
    for (PlaylistItem& item : list.items) item.schedule.reset();
    if (list.items.size() == 1) {
      PlaylistItem& item = list.items.front();
      item.loops = std::max<uint64_t>(item.loops, 1);  // once instead of forever
      if (request.seconds) item.duration_s = request.seconds;
      item.still_s.reset();
      if (!item.duration_s && item.loops == 1) item.still_s = kStillSeconds;
    }
    return std::make_shared<const Playlist>(std::move(list));
  }
  [[nodiscard]] nlohmann::ordered_json set_speed(uint32_t permille) {
    const std::lock_guard lock(mutex_);
    playback_.set_speed(permille);
    if (source_ != nullptr) source_->set_speed(permille / 1000.0);
    return {{"factor", permille / 1000.0}};
  }
  /// Shows the frame of a paused player again, with other overlays.
  void locked_show_again() {
    const DisplayedPlace displayed = playback_.displayed();
    const auto item = source_->account_of(static_cast<uint32_t>(displayed.item));
    const auto list = source_->list();
    if (!playback_.paused() || source_->status().opening || !item) return;
    if (list->has(item->index, item->source))
      source_->jump({.item = static_cast<int64_t>(*item->index), .frame = displayed.number},
                    [](const Error*) {});
  }
  [[nodiscard]] nlohmann::ordered_json show_over(const ControlRequest& request) {
    const std::optional<OverlaySpec>& overlay = request.overlay;
    std::shared_ptr<OverlaySet> set;
    if (overlay)
      set = std::make_shared<OverlaySet>(std::span(&*overlay, 1), plan_.context.pictures());
    const std::lock_guard lock(mutex_);
    steered().show_over(std::move(set), overlay ? overlay->for_s : std::nullopt);
    locked_show_again();
    return {{"overlay", overlay ? ordered_json(to_string(*overlay)) : ordered_json(nullptr)}};
  }
  /// Switches the output. Without a panel, the panel is switched when it is there.
  [[nodiscard]] nlohmann::ordered_json switch_output(bool on) {
    const bool done = playback_.switch_output(on, kLongestSwitch);
    return {{"power", on ? "on" : "off"}, {"done", done}};
  }
  /// Copies the displayed frame, or one panel's part of it, and returns its place.
  DisplayedPlace copy_displayed(const char* verb, frames::WovenFrame& into, size_t part = 0) {
    const DisplayedPlace place = playback_.displayed();
    if (!playback_.copy_shown(into, part))
      throw failed_error("{}: the displayed frame is not in memory", verb)
          .remedy("if the source keeps few frames, play with more --slots");
    return place;
  }
  [[nodiscard]] nlohmann::ordered_json take_snapshot(const ControlRequest& request) {
    const std::vector<WallPart>& wall = plan_.context.wall;
    const std::optional<size_t> part = part_for(request.panel, wall);
    frames::WovenFrame displayed(part ? wall[*part].panel : plan_.context.panel);
    const DisplayedPlace place = copy_displayed("snapshot", displayed, part.value_or(0));
    if (request.eye_mm) {
      const auto& [x, y, z] = *request.eye_mm;
      const optics::OpticalModel model(part ? wall[*part].rig : plan_.trim->rig());
      displayed = frames::seen_by(model, displayed.view(), {.x = x, .y = y, .z_mm = z});
    }
    frames::write_woven(displayed.view(), request.file);
    return {{"file", request.file},
            {"width", displayed.width()},
            {"height", displayed.height()},
            {"frame", place.number}};
  }
  /// Shares the displayed frame and the rig for which frames are woven now, with its trim.
  [[nodiscard]] DescriptorAnswer share_frame() {
    if (!plan_.trim) throw Error(ErrorKind::Failed, "frame: this player has no rig");
    frames::WovenFrame displayed(plan_.context.panel);
    const DisplayedPlace place = copy_displayed("frame", displayed);
    const std::string rig = optics::rig_to_toml(plan_.trim->rig());
    if (!frame_memory_) frame_memory_ = std::make_unique<FrameMemory>(plan_.context.panel);
    const uint64_t serial = frame_memory_->write(displayed, rig);
    return {.body = {{"serial", serial},
                     {"width", displayed.width()},
                     {"height", displayed.height()},
                     {"row_bytes", displayed.geometry().row_bytes()},
                     {"pixels_at", FrameMemory::kPixelsAt},
                     {"rig_at", FrameMemory::kPixelsAt + displayed.bytes().size()},
                     {"rig_bytes", rig.size()},
                     {"frame", place.number}},
            .descriptor = frame_memory_->descriptor()};
  }
  [[nodiscard]] std::shared_ptr<const Playlist> present_list() const {
    const std::lock_guard lock(mutex_);
    return steered().list();
  }
  void work_on(Answer answer, std::function<void(const Answer&)> task) {
    {
      const std::lock_guard lock(tasks_mutex_);
      if (tasks_.size() >= kMaxTasks)
        throw Error(ErrorKind::Failed, "control: too many requests are pending", "try again later");
      tasks_.push_back({std::move(answer), std::move(task)});
    }
    task_there_.notify_one();
  }
  void work(const std::stop_token& stop) noexcept {
    std::unique_lock lock(tasks_mutex_);
    while (task_there_.wait(lock, stop, [this] { return !tasks_.empty(); }) &&
           !stop.stop_requested()) {
      const Task task = std::move(tasks_.front());
      tasks_.pop_front();
      lock.unlock();
      try {
        task.run(task.answer);
      } catch (const Error& error) {
        task.answer(error);
      } catch (const std::exception& error) {
        task.answer(Error(ErrorKind::Failed, error.what()));
      }
      lock.lock();
    }
  }
  [[nodiscard]] nlohmann::ordered_json trim_json(const optics::Trim& trim) const {
    return {{"offset_lenses", trim.offset.value}, {"pitch_relative", trim.pitch_relative}};
  }

  const PlayPlan& plan_;
  const PlaylistReader read_playlist_;
  PlaybackControl playback_;

  mutable std::mutex mutex_;  ///< guards the members below
  PlaylistSource* source_ = nullptr;
  nlohmann::ordered_json statistics_;
  PlayState run_ = kStarting;

  std::unique_ptr<FrameMemory> frame_memory_;  ///< used by the worker thread

  // Slow tasks (reading lists, encoding pictures), run one after the other.
  struct Task {
    Answer answer;
    std::function<void(const Answer&)> run;
  };
  std::mutex tasks_mutex_;
  std::condition_variable_any task_there_;
  std::deque<Task> tasks_;
  std::jthread worker_;  // last member: the thread uses everything above
};

/// Only measures the source's pace if the source is plain, without control socket and proof. Thread
/// safety: the player's main thread.
class SteeredPlay {
 public:
  /// Starts to listen. Throws as ControlServer does.
  SteeredPlay(const PlayFlags& flags, const PlayPlan& plan)
      : flags_(flags), plan_(plan), is_list_(plan.source.kind == SourceKind::List) {
    if (is_list_ && plan.context.frames)
      throw Error(ErrorKind::Usage, "--frames: not allowed for a list",
                  "write frames = \"A:B\" in its [[item]]");
    if (plan.trim) trim_version_ = plan.trim->version();
    if (flags.control.empty()) return;
    controls_ = std::make_unique<PlayControls>(plan, [this](const std::string& text) {
      // The flags of the command line apply to its own source alone.
      const SourceSpec& own = plan_.source;
      const SourceSpec source = text == own.text ? own : parse_source(text);
      Playlist list = read_playlist(source, flags_, plan_);
      // Sources loaded over the control socket loop until the next command.
      const bool for_ever = flags_.loop.empty() && source.kind != SourceKind::List;
      if (for_ever) list.items.front().loops = kForever;
      return list;
    });
    listen();
  }
  ~SteeredPlay() { detach_source(); }

  /// Opens the source as open_source() does, after it has closed the one in `opened`.
  void open(OpenedSource& opened) {
    detach_source();
    if (!is_list_ && !controls_ && !plan_.proof && !is_followed(plan_)) {
      opened = open_source(plan_.source, plan_.context);
      const PlaylistItem item = read_playlist(plan_.source, flags_, plan_).items.front();
      if (plan_.sound)
        opened.begin_sound = plan_.sound->open(item, plan_.playback.content, 0, *opened.source);
      if (opened.begin_sound) opened.begin_sound(0, item.loops);
      if (plan_.trim) plan_.trim->note_content(opened.woven_elsewhere);
      const auto count = opened.source->frame_count();
      const bool still = count ? *count == 1 : plan_.source.may_be_still();
      const bool is_live = opened.live != nullptr;  // which may be lost and come back
      if (!is_live && (!still || !plan_.source.has_pictures())) return;
    } else {
      opened = {};
    }
    // A still picture or a camera is an item of a list, which knows how long it stays.
    const auto first = std::make_shared<OpenedSource>(std::exchange(opened, {}));
    auto source = std::make_unique<PlaylistSource>(
        std::make_shared<const Playlist>(read_playlist(plan_.source, flags_, plan_)),
        PlaylistSourceOptions{
            .panel = plan_.context.panel,
            .panels = plan_.context.pictures(),
            .open =
                [first, open = item_opener(plan_)](const PlaylistItem& item, uint64_t frame) {
                  return first->source ? std::exchange(*first, {}) : open(item, frame);
                },
            .rate = plan_.playback.content,
            .on_event = [this](const PlaylistEvent& event) { on_item(event); },
            .marks_of = marks_of_item,
            .read_list =
                [this](const std::string& name) {
                  return read_playlist(parse_source(name), flags_, plan_);
                },
            .mark_list =
                [folders = plan_.folders](const std::string& name) { return folders->mark(name); },
            .outlasts_faults = plan_.outlasts_faults,
            .left_item = controls_ ? left_item_of(controls_->playback()) : nullptr,
            .longest_wait = flags_.wait.empty() ? std::nullopt : plan_.playback.stall_timeout});
    source->open_first();
    source_ = source.get();
    opened.source = std::move(source);
    if (controls_) controls_->steer(source_);
  }
  /// Detaches from the source; call it before the source is destroyed.
  void detach_source() {
    if (controls_) controls_->steer(nullptr);
    source_ = nullptr;
  }
  /// Sets the playback options that lists and control need.
  void prepare(PlaybackOptions& options, frames::Rate refresh) {
    report_state({});
    if (source_ == nullptr) return;
    source_->set_display_rate(refresh);
    options.overlays = [source = source_](const auto& frame) { return source->boxes_over(frame); };
    options.loops = 1;  // the list counts the loops itself
    if (!controls_) return;
    options.control = &controls_->playback();
    source_->set_speed(controls_->playback().speed_permille() / 1000.0);
  }
  /// Switches the output off after the first frame, as it was in the previous player.
  void begin_off() {
    if (controls_) (void)controls_->playback().switch_output(false, std::chrono::milliseconds(0));
  }
  /// Checks the list's and the item's files now.
  void look_again() {
    if (source_ != nullptr) source_->look_again();
  }
  /// Sets the state of the run, and publishes an event if that of the player changed.
  void report_state(const PlayState& run) {
    run_ = run;
    if (controls_) controls_->report_state(run);
    publish_state();
  }
  /// Call about once a second: updates the statistics, warns, and publishes events.
  void report(const PlayReport& report) {
    const auto now = std::chrono::steady_clock::now();
    if (controls_ && !server_ && listening_.due(now)) listen();
    if (controls_) controls_->end_overlay();
    (void)pace_.look(report, now);
    if (const auto warning = pace_.warning(now)) {
      say("{}\n", *warning);
      publish({{"event", "too_slow"}, {"figures", to_json(pace_.figures())}});
    }
    publish_changes(report);
  }
  void complete(nlohmann::ordered_json& statistics) {
    const PlayState player = state();
    statistics["state"] = player.word;
    statistics["reason"] = player.reason;
    statistics["source_pace"] = to_json(pace_.figures());
    if (source_ != nullptr) {
      const PlaylistStatus status = source_->status();
      statistics["loops"] = status.loops;
      if (status.live) statistics["live"] = to_json(*status.live);
      statistics["playlist"] = {{"list", status.list},
                                {"source", status.source},
                                {"items", status.items},
                                {"rounds_done", status.rounds_done},
                                {"items_started", status.started},
                                {"seams", status.loop_points},
                                {"items_skipped", status.skipped},
                                {"last_problem", status.last_problem},
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
  /// Returns the account of an item's turn, if it is remembered.
  [[nodiscard]] std::optional<ItemAccount> account_of(uint64_t item) const {
    if (source_ == nullptr) return std::nullopt;
    std::optional<ItemAccount> account = source_->account_of(static_cast<uint32_t>(item));
    if (account && plan_.sound) account->sound = plan_.sound->account_of(item);
    return account;
  }
  /// Returns why the playback failed: an only item that failed, or a list without a playable item.
  /// Empty otherwise.
  [[nodiscard]] std::string failure() const {
    if (source_ == nullptr) return {};
    const PlaylistStatus status = source_->status();
    const bool nothing_played = status.started == 0;
    const bool only_one_broke = !is_list_ && status.started <= 1 && status.skipped > 0;
    if (!nothing_played && !only_one_broke) return {};
    if (is_list_ && !status.state.plays()) return status.list + ": " + status.state.reason;
    return status.last_problem.empty() ? "none of its items could be played" : status.last_problem;
  }

 private:
  using ordered_json = nlohmann::ordered_json;
  static constexpr size_t kMaxComplaints = 1000;

  static bool folder_exists(const std::filesystem::path& file) {
    std::error_code error;
    return std::filesystem::is_directory(file.has_parent_path() ? file.parent_path() : ".", error);
  }

  static std::vector<FileMark> marks_of_item(const PlaylistItem& item) {
    std::vector<FileMark> marks = marks_of_source(item.source);
    for (const OverlaySpec& overlay : item.overlays)
      if (overlay.kind == OverlaySpec::Kind::Picture) marks.push_back(mark_of(overlay.content));
    return marks;
  }

  /// Returns true if the source is a file that is shown again, which may be replaced meanwhile.
  static bool is_followed(const PlayPlan& plan) {
    return plan.playback.loops != 1 && !marks_of_source(plan.source).empty();
  }

  static std::function<LeftItem(uint32_t)> left_item_of(const PlaybackControl& playback) {
    return [&playback](uint32_t number) { return playback.left_item(number); };
  }

  /// Opens the control socket. A full disk must not prevent playing, so a failure is retried.
  void listen() {
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
  /// Called on the list's threads.
  void on_item(const PlaylistEvent& event) {
    using Kind = PlaylistEvent::Kind;
    if (plan_.trim && (event.kind == Kind::ItemStarted || event.kind == Kind::Returned))
      plan_.trim->note_content(event.woven_elsewhere);
    const bool is_fault = event.kind == Kind::ItemSkipped || event.kind == Kind::Kept ||
                          event.kind == Kind::BadOverlay;
    if (is_fault && interrupted()) return;  // a signal ends what opens an item, too
    switch (event.kind) {
      case Kind::ItemStarted:
        return publish({{"event", "item_started"}, {"source", event.source}});
      case Kind::Returned:
        return publish({{"event", "returned"}, {"source", event.source}});
      case Kind::LoopPoint:
        return publish({{"event", "seam"}, {"source", event.source}});
      case Kind::Waiting:
        return say("{}: {}\n", event.source, event.detail);
      case Kind::ItemDamaged:
        publish({{"event", "damaged_item"}, {"source", event.source}, {"cause", event.detail}});
        return complain("damaged", event);
      case Kind::Still:
        return complain("taken for a picture", event);
      case Kind::ItemSkipped:
        publish({{"event", "bad_item"}, {"source", event.source}, {"cause", event.detail}});
        return complain("left out", event);
      case Kind::BadOverlay:
        publish({{"event", "bad_overlay"}, {"cause", event.detail}});
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
  void complain(const std::string& how, const PlaylistEvent& event) {
    const bool named = event.detail.starts_with(event.source);
    const std::string complaint = named ? event.detail : event.source + ": " + event.detail;
    // The number of damaged frames may differ from round to round, the item is reported once.
    const bool damaged = event.kind == PlaylistEvent::Kind::ItemDamaged;
    const std::lock_guard lock(reported_mutex_);
    if (reported_.size() < kMaxComplaints &&
        reported_.insert(damaged ? event.source : complaint).second)
      say("{}: {}\n", how, complaint);
  }
  void publish(nlohmann::ordered_json event) {
    if (ControlServer* const server = serving_.load()) server->publish(std::move(event));
  }
  [[nodiscard]] PlayState state() const {
    PlayState list = source_ != nullptr ? source_->status().state : PlayState();
    if (source_ == nullptr && before_.pace.shown == 0)
      list = plan_.source.kind == SourceKind::Ring ? kNoRenderer : kStarting;
    return controls_ ? controls_->state_with(run_, list) : run_.plays() ? list : run_;
  }
  void publish_state() {
    const PlayState now = state();
    if (std::exchange(published_, now) != now)
      publish({{"event", "state"}, {"state", now.word}, {"reason", now.reason}});
  }
  void publish_changes(const PlayReport& report) {
    const uint64_t missed = report.pace.missed - before_.pace.missed;
    const uint64_t late = report.pace.repeated_underrun - before_.pace.repeated_underrun;
    publish_state();
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

  const PlayFlags& flags_;
  const PlayPlan& plan_;
  const bool is_list_;
  std::unique_ptr<PlayControls> controls_;
  std::unique_ptr<ControlServer> server_;
  std::atomic<ControlServer*> serving_{nullptr};  ///< server_, for all threads
  RetriedWrites listening_;                       ///< retries to open the socket
  PlaylistSource* source_ = nullptr;
  SourcePace pace_;
  PlayReport before_;
  uint64_t trim_version_ = 0;
  PlayState run_ = kStarting, published_ = run_;
  std::mutex reported_mutex_;
  std::set<std::string> reported_;  ///< complaints already printed; each is printed once
};

}  // namespace lenticule::player
