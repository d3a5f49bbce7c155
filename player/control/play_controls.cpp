// SPDX-License-Identifier: Apache-2.0
#include "player/control/play_controls.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <atomic>
#include <cerrno>
#include <cstring>
#include <utility>

#include "base/error.h"
#include "base/print.h"
#include "base/text.h"
#include "frames/image_io.h"
#include "frames/rational.h"
#include "optics/eye_simulator.h"
#include "optics/rig_file.h"

namespace lenticule::player {
namespace {

[[noreturn]] void fail(const char* cause) {
  throw Error(ErrorKind::Failed, std::string("frame: ") + cause + ": " + std::strerror(errno));
}

}  // namespace

FrameMemory::FrameMemory(const frames::FrameGeometry& geometry) : pixels_(geometry.frame_bytes()) {
  UniqueFd fd(::memfd_create("lenticule-frame", MFD_CLOEXEC | MFD_ALLOW_SEALING));
  const size_t bytes = kPixelsAt + pixels_ + kMaxText;  // pages without content take no memory
  if (!fd || ::ftruncate(fd.get(), static_cast<off_t>(bytes)) != 0) fail("no shared memory");
  void* const mapped = ::mmap(nullptr, bytes, PROT_READ | PROT_WRITE, MAP_SHARED, fd.get(), 0);
  if (mapped == MAP_FAILED) fail("no shared memory");
  bytes_ = static_cast<uint8_t*>(mapped);
  constexpr int kSeals = F_SEAL_FUTURE_WRITE | F_SEAL_SHRINK | F_SEAL_GROW | F_SEAL_SEAL;
  if (::fcntl(fd.get(), F_ADD_SEALS, kSeals) != 0) {
    const int error = errno;
    ::munmap(bytes_, bytes);
    errno = error;
    fail("cannot seal shared memory");
  }
  fd_ = std::make_shared<const UniqueFd>(std::move(fd));
}

uint64_t FrameMemory::write(const frames::WovenFrame& frame, std::string_view text) {
  LENTICULE_CHECK(frame.bytes().size() == pixels_);
  if (text.size() > kMaxText)
    throw Error(ErrorKind::Failed, "frame: the rig is too large to be sent");
  auto& shared = *reinterpret_cast<uint64_t*>(bytes_);
  std::atomic_ref<uint64_t> serial(shared);
  serial.store(0);
  std::atomic_thread_fence(std::memory_order_seq_cst);
  std::memcpy(bytes_ + kPixelsAt, frame.bytes().data(), pixels_);
  std::memcpy(bytes_ + kPixelsAt + pixels_, text.data(), text.size());
  serial.store(++serial_);
  return serial_;
}

namespace {

using nlohmann::ordered_json;

constexpr std::array<const char*, 7> kDays = {"mon", "tue", "wed", "thu", "fri", "sat", "sun"};

ordered_json loops_json(uint64_t loops) {
  return loops == kForever ? ordered_json("forever") : ordered_json(loops);
}

std::string clock_text(int minute) {
  return fmt::format("{:02}:{:02}", minute / 60, minute % 60);
}

ordered_json schedule_json(const Schedule& schedule) {
  ordered_json days = ordered_json::array();
  for (size_t day = 0; day < kDays.size(); ++day)
    if ((schedule.days >> day & 1u) != 0) days.push_back(kDays.at(day));
  return {{"days", days},
          {"from", clock_text(schedule.from_minute)},
          {"to", clock_text(schedule.to_minute)}};
}

/// Returns the name of the source for a reader with another working folder.
std::string whole_name(const SourceSpec& source) {
  const SourceSpec whole = source.in_folder(std::filesystem::current_path());
  return whole == source ? source.text
                         : std::filesystem::path(whole.text).lexically_normal().string();
}

ordered_json item_json(const PlaylistItem& item) {
  ordered_json json = {{"source", whole_name(item.source)}};
  if (item.duration_s)
    json["duration_s"] = *item.duration_s;
  else if (!item.still_s || item.loops != 1)
    json["loops"] = loops_json(item.loops);
  if (item.rate) json["fps"] = frames::to_string(*item.rate);
  if (item.frames) json["frames"] = fmt::format("{}:{}", item.frames->begin, item.frames->end);
  if (item.waits_until_primed) json["cut"] = "primed";
  if (item.wait_s != PlaylistItem{}.wait_s) json["wait_s"] = item.wait_s;
  if (item.schedule) json["schedule"] = schedule_json(*item.schedule);
  return json;
}

}  // namespace

ordered_json list_json(const Playlist& list, size_t first, size_t most_bytes) {
  ordered_json json;
  json["file"] = nullptr;
  if (list.file) json["file"] = std::filesystem::absolute(list.name).lexically_normal().string();
  json["loop"] = loops_json(list.rounds);
  json["default"] = list.standby ? item_json(*list.standby) : ordered_json(nullptr);
  json["count"] = list.items.size();
  json["first"] = first;
  json["items"] = ordered_json::array();
  size_t bytes = 0;
  for (size_t k = first; k < list.items.size() && bytes < most_bytes; ++k) {
    json["items"].push_back(item_json(list.items[k]));
    bytes += json_text(json["items"].back()).size();
  }
  return json;
}

namespace {

using nlohmann::ordered_json;

constexpr size_t kMaxTasks = 4;
constexpr auto kLongestSwitch = std::chrono::seconds(5);

Error nothing_to_steer() {
  return {ErrorKind::Failed, "control: nothing is playing",
          "'status' says what the player is doing"};
}

ordered_json place_json(const PlaylistStatus& status) {
  ordered_json json = {{"list", status.list}, {"source", status.source}};
  json["item"] = status.item ? ordered_json(*status.item) : ordered_json(nullptr);
  json["items"] = status.items;
  return json;
}

/// Returns the index of the panel of a wall; none if the player shows one panel.
std::optional<size_t> part_for(const std::string& name, const std::vector<WallPanel>& wall) {
  if (wall.empty() && name.empty()) return std::nullopt;
  if (wall.empty())
    throw Error(ErrorKind::Usage, "panel: this player shows one panel", "leave --panel out");
  const auto found = std::ranges::find(wall, name, &WallPanel::name);
  if (found != wall.end()) return static_cast<size_t>(found - wall.begin());
  std::vector<std::string> names;
  for (const WallPanel& panel : wall) names.push_back(panel.name);
  throw Error(ErrorKind::Usage, "panel: " + (name.empty() ? "none is named" : "no '" + name + "'"),
              fmt::format("this player shows {}", fmt::join(names, ", ")));
}

frames::WovenFrame seen_by(const optics::Rig& rig, const frames::WovenFrame& woven,
                           const std::array<double, 3>& eye) {
  const optics::OpticalModel model(rig);
  const optics::RgbPicture seen =
      optics::simulate_eye(model,
                           {.pixels = woven.bytes().data(),
                            .width = woven.width(),
                            .height = woven.height(),
                            .stride_bytes = woven.geometry().row_bytes()},
                           {.x = eye[0], .y = eye[1], .z_mm = eye[2]});
  frames::WovenFrame picture({.width = seen.width, .height = seen.height});
  std::copy(seen.pixels.begin(), seen.pixels.end(), picture.bytes().begin());
  return picture;
}

}  // namespace

PlayControls::PlayControls(PlayControlsOptions options) : options_(std::move(options)) {
  worker_ = std::thread([this] { work(); });
}

PlayControls::~PlayControls() {
  {
    const std::lock_guard lock(tasks_mutex_);
    stopping_ = true;
  }
  task_there_.notify_all();
  worker_.join();
}

void PlayControls::steer(PlaylistSource* source) {
  const std::lock_guard lock(mutex_);
  source_ = source;
}

void PlayControls::report_statistics(const ordered_json& statistics) {
  const std::lock_guard lock(mutex_);
  statistics_ = statistics;
}

void PlayControls::report_state(const std::string& state) {
  const std::lock_guard lock(mutex_);
  state_ = state;
}

void PlayControls::handle(const ControlRequest& request, ControlRights rights, Answer answer) {
  const Jump aside{.item = request.verb == ControlVerb::Next ? 1 : -1, .relative = true};
  switch (request.verb) {
    case ControlVerb::Status:
      return answer(status());
    case ControlVerb::Stats:
      return answer(statistics());
    case ControlVerb::Doctor:
      return answer(doctor());
    case ControlVerb::Play:
    case ControlVerb::Pause:
      return answer(pause(request.verb == ControlVerb::Pause));
    case ControlVerb::Next:
    case ControlVerb::Previous:
      return jump(aside, answer);
    case ControlVerb::Seek: {
      Jump where{.frame = request.frame.value_or(0)};
      if (request.item) where.item = static_cast<int64_t>(*request.item);
      return jump(where, answer);
    }
    case ControlVerb::Load:
      return load(request, answer);
    case ControlVerb::Interrupt:
      return interrupt(request, answer);
    case ControlVerb::Blank:
      return blank(answer);
    case ControlVerb::Back:
      return back(answer);
    case ControlVerb::Cue:
      return cue(request, answer);
    case ControlVerb::Go:
      return go(answer);
    case ControlVerb::Speed:
      return answer(set_speed(request.speed_permille));
    case ControlVerb::Power:
      return work_on(answer,
                     [this, request](const Answer& done) { done(switch_output(request.on)); });
    case ControlVerb::Loop:
      return answer(set_loops(request.loops));
    case ControlVerb::Trim:
      return answer(change_trim(request));
    case ControlVerb::Rig:
      return work_on(answer, [this, request](const Answer& done) { done(replace_rig(request)); });
    case ControlVerb::Snapshot:
      if (rights != ControlRights::Everything)
        throw Error(
            ErrorKind::Device,
            "snapshot: not permitted, because the file would be written as the player's user",
            "connect as the player's user, or as root");
      return snapshot(request, answer);
    case ControlVerb::Frame:
      return work_on(answer, [this](const Answer& done) { done(share_frame()); });
    case ControlVerb::List:
      return answer(list(request));
    case ControlVerb::Quit:
      answer(ordered_json{{"quitting", true}});
      return options_.quit();
    case ControlVerb::Subscribe:
      break;
  }
  throw Error(ErrorKind::Usage, "control: the player does not handle this request");
}

// --- queries --------------------------------------------------------------------------------

/// Returns the frame displayed at this moment and the item being read; around a change the two
/// differ for a few frames.
ordered_json PlayControls::status() const {
  const DisplayedPlace displayed = playback_.displayed();
  const std::lock_guard lock(mutex_);
  const bool playing = state_ == "playing";
  const char* const held = playback_.is_off() ? "off" : playback_.paused() ? "paused" : nullptr;
  ordered_json json = {{"state", playing && held != nullptr ? held : state_},
                       {"speed", playback_.speed_permille() / 1000.0},
                       {"frames_shown", displayed.frames},
                       {"log_lines_dropped", dropped_log_lines()}};
  json["displayed"] = nullptr;
  if (source_ != nullptr) {
    const auto play = static_cast<uint32_t>(displayed.item);
    const PlaylistStatus status = source_->status();
    if (displayed.frames > 0) {
      const ItemAccount item = source_->account_of(play).value_or(ItemAccount{});
      json["displayed"] = {{"source", item.source.text}, {"frame", displayed.number}};
      json["displayed"]["item"] = item.index ? ordered_json(*item.index) : ordered_json(nullptr);
    }
    json["reading"] = place_json(status);
    json["reading"]["frames"] =
        status.frames ? ordered_json(*status.frames) : ordered_json(nullptr);
    json["rounds_done"] = status.rounds_done;
    json["opening"] = status.opening;
    for (const auto& [key, text] :
         {std::pair("cued", status.cued), std::pair("interrupted", status.interrupted),
          std::pair("waiting_for", status.waiting_for)})
      json[key] = text.empty() ? ordered_json(nullptr) : ordered_json(text);
    json["items_skipped"] = status.skipped;
    json["last_problem"] = status.last_problem;
    json.update(to_json(status.damage));
  }
  if (options_.trim) json["trim"] = trim_json(options_.trim->trim());
  for (const char* key : {"write_problems", "rig_problem"})
    if (statistics_.contains(key)) json[key] = statistics_[key];
  // Before the first report there are no statistics.
  if (statistics_.contains("stall") && statistics_["stall"] != "")
    json["last_problem"] = statistics_["stall"];
  return json;
}

ordered_json PlayControls::statistics() const {
  const std::lock_guard lock(mutex_);
  return {{"statistics", statistics_}};
}

ordered_json PlayControls::doctor() const {
  const std::lock_guard lock(mutex_);
  ordered_json json;
  for (const char* key : {"display", "exactness", "kms", "waiting_for", "source_pace"})
    json[key] = statistics_.contains(key) ? statistics_[key] : ordered_json(nullptr);
  return json;
}

// --- playback control -----------------------------------------------------------------------

ordered_json PlayControls::pause(bool paused) {
  {
    const std::lock_guard lock(mutex_);
    if (source_ != nullptr) source_->hold(paused);
  }
  playback_.pause(paused);
  return {{"paused", paused}};
}

ordered_json PlayControls::set_loops(uint64_t loops) {
  const std::lock_guard lock(mutex_);
  if (source_ == nullptr) throw nothing_to_steer();
  source_->set_loops(loops);
  ordered_json json;
  json["count"] = loops == kForever ? ordered_json("forever") : ordered_json(loops);
  return json;
}

/// Jumps to another place. The answer is sent when its first frame is taken, or when the jump has
/// failed.
void PlayControls::jump(Jump where, const Answer& answer) {
  const std::lock_guard lock(mutex_);
  if (source_ == nullptr) throw nothing_to_steer();
  PlaylistSource* const source = source_;
  const uint64_t frame = where.frame;
  source->jump(where, [answer, source, frame](const Error* error) {
    if (error != nullptr) return answer(*error);
    ordered_json json = place_json(source->status());
    json["frame"] = frame;
    answer(std::move(json));
  });
}

void PlayControls::load(const ControlRequest& request, const Answer& answer) {
  work_on(answer, [this, request](const Answer& done) {
    Jump where{.list = std::make_shared<const Playlist>(options_.read_playlist(request.source)),
               .item = static_cast<int64_t>(request.item.value_or(0)),
               .frame = request.frame.value_or(0)};
    jump(std::move(where), done);
  });
}

/// Returns the list that an interruption plays once.
std::shared_ptr<const Playlist> PlayControls::interruption_of(const ControlRequest& request) const {
  Playlist list;
  if (request.item) {
    std::shared_ptr<const Playlist> playing;
    {
      const std::lock_guard lock(mutex_);
      if (source_ == nullptr) throw nothing_to_steer();
      playing = source_->list();
    }
    if (*request.item >= playing->items.size())
      throw Error(
          ErrorKind::Usage,
          fmt::format("item {}: the list has {} items", *request.item, playing->items.size()),
          "items are counted from 0");
    list = {.name = playing->name, .items = {playing->items[*request.item]}, .standby = {}};
  } else {
    list = options_.read_playlist(request.source);
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

void PlayControls::interrupt(const ControlRequest& request, const Answer& answer) {
  work_on(answer, [this, request](const Answer& done) {
    jump({.list = interruption_of(request),
          .item = 0,
          .frame = request.frame.value_or(0),
          .interrupts = true},
         done);
  });
}

/// Shows a black frame until back().
void PlayControls::blank(const Answer& answer) {
  jump({.list = std::make_shared<const Playlist>(playlist_of(parse_source("black"), kForever)),
        .item = 0,
        .interrupts = true},
       answer);
}

void PlayControls::back(const Answer& answer) {
  const std::lock_guard lock(mutex_);
  if (source_ == nullptr) throw nothing_to_steer();
  if (source_->status().interrupted.empty())
    return answer(ConflictAnswer{{ErrorKind::Failed, "back: nothing is interrupted",
                                  "'interrupt' and 'blank' begin an interruption"}});
  source_->return_now([answer, source = source_](const Error* error) {
    if (error != nullptr) return answer(*error);
    answer(place_json(source->status()));
  });
}

void PlayControls::cue(const ControlRequest& request, const Answer& answer) {
  work_on(answer, [this, request](const Answer& done) {
    Jump where{.frame = request.frame.value_or(0), .interrupts = request.then_back};
    if (request.then_back)
      where.list = interruption_of(request);
    else if (!request.item)
      where.list = std::make_shared<const Playlist>(options_.read_playlist(request.source));
    where.item = request.item && !request.then_back ? static_cast<int64_t>(*request.item) : 0;
    const std::lock_guard lock(mutex_);
    if (source_ == nullptr) throw nothing_to_steer();
    source_->cue(where, [done, source = source_](const Error* error) {
      if (error != nullptr) return done(*error);
      done(ordered_json{{"cued", source->status().cued}});
    });
  });
}

/// Shows the cued item. A second request before its first frame is displayed changes nothing, as
/// that of a button that bounces.
void PlayControls::go(const Answer& answer) {
  const std::lock_guard lock(mutex_);
  if (source_ == nullptr) throw nothing_to_steer();
  if (!playback_.time_next_cut()) return answer(ordered_json{{"already_going", true}});
  if (source_->status().cued.empty()) {
    playback_.forget_next_cut();
    return answer(
        ConflictAnswer{{ErrorKind::Failed, "go: no item is cued", "cue one first: cue SOURCE"}});
  }
  source_->go([this, answer, source = source_](const Error* error) {
    if (error == nullptr) return answer(place_json(source->status()));
    playback_.forget_next_cut();
    answer(*error);
  });
}

ordered_json PlayControls::set_speed(uint32_t permille) {
  const std::lock_guard lock(mutex_);
  playback_.set_speed(permille);
  if (source_ != nullptr) source_->set_speed(permille / 1000.0);
  return {{"factor", permille / 1000.0}};
}

/// Switches the output. Without a panel, the panel is switched when it is there.
ordered_json PlayControls::switch_output(bool on) {
  const bool done = playback_.switch_output(on, kLongestSwitch);
  return {{"power", on ? "on" : "off"}, {"done", done}};
}

ordered_json PlayControls::change_trim(const ControlRequest& request) {
  if (!options_.trim) throw Error(ErrorKind::Failed, "trim: this player cannot change the trim");
  const optics::Trim now = options_.trim->change([&](const optics::Trim& trim) {
    if (request.relative)
      return optics::changed_by(trim, request.offset_lenses.value_or(0.0),
                                request.pitch_relative.value_or(0.0));
    return optics::Trim{.offset = Lenses(request.offset_lenses.value_or(trim.offset.value)),
                        .pitch_relative = request.pitch_relative.value_or(trim.pitch_relative)};
  });
  ordered_json json = trim_json(now);
  const std::string problem = options_.trim->why_unsaved();
  json["saved"] = problem.empty();
  if (!problem.empty()) json["problem"] = problem;
  if (std::string advice = options_.trim->advice(); !advice.empty())
    json["advice"] = std::move(advice);
  return json;
}

/// Replaces the player's own rig file by a new calibration of the same panel.
ordered_json PlayControls::replace_rig(const ControlRequest& request) {
  if (!options_.trim) throw Error(ErrorKind::Failed, "rig: this player has no rig");
  const optics::Rig rig = optics::parse_rig(request.rig_toml, "rig");
  const std::filesystem::path kept = options_.trim->replace_rig(rig);
  return {{"fingerprint", optics::fingerprint(rig)}, {"old_rig_kept_as", kept.string()}};
}

void PlayControls::snapshot(const ControlRequest& request, const Answer& answer) {
  frames::check_writable_format(request.file);
  work_on(answer, [this, request](const Answer& done) { done(take_snapshot(request)); });
}

ordered_json PlayControls::take_snapshot(const ControlRequest& request) {
  const std::optional<size_t> part = part_for(request.panel, options_.wall);
  frames::WovenFrame displayed(part ? options_.wall[*part].size : options_.panel);
  const DisplayedPlace place = playback_.displayed();
  if (!playback_.copy_shown(displayed, part.value_or(0)))
    throw Error(ErrorKind::Failed, "snapshot: the displayed frame is not in memory",
                "if the source keeps few frames, play with more --slots");
  if (request.eye_mm) {
    const optics::Rig rig = part ? options_.wall[*part].rig : options_.trim->rig();
    displayed = seen_by(rig, displayed, *request.eye_mm);
  }
  frames::write_woven(displayed.view(), request.file);
  return {{"file", request.file},
          {"width", displayed.width()},
          {"height", displayed.height()},
          {"frame", place.number}};
}

/// Shares the displayed frame and the rig for which frames are woven now, with its trim.
DescriptorAnswer PlayControls::share_frame() {
  if (!options_.trim) throw Error(ErrorKind::Failed, "frame: this player has no rig");
  frames::WovenFrame displayed(options_.panel);
  const DisplayedPlace place = playback_.displayed();
  if (!playback_.copy_shown(displayed))
    throw Error(ErrorKind::Failed, "frame: the displayed frame is not in memory",
                "if the source keeps few frames, play with more --slots");
  const std::string rig = optics::rig_to_toml(options_.trim->rig());
  if (!frame_memory_) frame_memory_ = std::make_unique<FrameMemory>(options_.panel);
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

ordered_json PlayControls::list(const ControlRequest& request) const {
  std::shared_ptr<const Playlist> playing;
  {
    const std::lock_guard lock(mutex_);
    if (source_ == nullptr) throw nothing_to_steer();
    playing = source_->list();
  }
  return list_json(*playing, request.item.value_or(0));
}

// --- background tasks -----------------------------------------------------------------------

void PlayControls::work_on(Answer answer, std::function<void(const Answer&)> task) {
  {
    const std::lock_guard lock(tasks_mutex_);
    if (tasks_.size() >= kMaxTasks)
      throw Error(ErrorKind::Failed, "control: too many requests are pending", "try again later");
    tasks_.push_back({std::move(answer), std::move(task)});
  }
  task_there_.notify_one();
}

void PlayControls::work() noexcept {
  std::unique_lock lock(tasks_mutex_);
  while (true) {
    task_there_.wait(lock, [this] { return stopping_ || !tasks_.empty(); });
    if (stopping_) return;
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

}  // namespace lenticule::player
