// SPDX-License-Identifier: Apache-2.0
#include "player/playlist/playlist.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <ctime>
#include <iterator>
#include <numeric>

#include "base/error_kinds.h"
#include "base/numbers.h"
#include "base/text.h"
#include "frames/quilt.h"
#include "frames/views_input/content_name.h"
#include "frames/weave.h"
#include "optics/json_fields.h"
#include "optics/toml.h"
#include "player/playlist/folder_lists.h"
#include "player/sources/content.h"

namespace lenticule::player {
namespace {

constexpr int64_t kMaxLoops = 1'000'000'000;
constexpr double kMaxSeconds = 1e6;
constexpr double kMaxTransitionSeconds = 10.0;
constexpr size_t kMaxSourceBytes = 4096;
constexpr int kMinutesPerDay = 24 * 60;
constexpr int kLongestSearchDays = 3653;
constexpr std::chrono::sys_days kFirstMonday = std::chrono::year(1969) / 12 / 29;
constexpr std::chrono::year kEveryYear(0);
constexpr std::string_view kByteOrderMark = "\xEF\xBB\xBF";

/// Returns true if spans of the schedule may begin on this day.
bool begins_on(const Schedule& schedule, int day) {
  const auto contains = [day](const DateSpan& span) { return span.contains(day); };
  return ((schedule.days >> LocalTime{.day = day}.weekday()) & 1) != 0 &&
         (schedule.dates.empty() || std::ranges::any_of(schedule.dates, contains)) &&
         std::ranges::none_of(schedule.except, contains);
}

/// Mixes a number well enough that neighbours look independent (the finalizer of SplitMix64).
uint64_t mixed(uint64_t number) {
  number += 0x9e3779b97f4a7c15U;
  number = (number ^ (number >> 30)) * 0xbf58476d1ce4e5b9U;
  number = (number ^ (number >> 27)) * 0x94d049bb133111ebU;
  return number ^ (number >> 31);
}

/// Reader parses one list and adds its name and line to every error.
class Reader {
 public:
  Reader(std::string name, std::filesystem::path folder)
      : name_(std::move(name)), folder_(std::move(folder)) {}

  [[nodiscard]] Playlist read(std::string_view text) const {
    const toml::table root = optics::parse_toml(text, name_);
    Playlist list{.name = name_, .items = {}, .standby = {}, .rounds = 1};
    for (const auto& [key, node] : root) {
      if (key.str() == "format") {
        // toml++'s conversion to a whole number is undefined for a float that is too large, so the
        // type is checked first.
        const auto* const format = node.as_integer();
        if (format == nullptr || format->get() != 1) fail(node, "format: unknown; expected 1");
      } else if (takes_setting(list, std::string(key.str()), node)) {
        key_.clear();
      } else if (key.str() == "default") {
        list.standby = item(node);
        if (names_folder(list.standby->source.text))
          fail(node, "default: must not be a folder", "name one film or picture");
        if (list.standby->schedule)
          fail(node, "default: must not have a schedule: it plays when no item is scheduled");
      } else if (key.str() == "item") {
        items(node, list);
      } else {
        fail_at(key.source().begin.line, fmt::format("unknown key '{}'", key.str().substr(0, 64)),
                "a list has format, loop, shuffle, transition, transition_seconds, sound, "
                "sound_volume, [[overlay]], [default] and [[item]]");
      }
    }
    if (list.items.empty()) fail_at(1, "no [[item]]", "an item needs at least source = \"...\"");
    check_transitions(list, root);
    if (list.standby) share_settings(list, *list.standby);
    for (PlaylistItem& item : list.items) share_settings(list, item);
    return list;
  }
  /// Reads the list of a Looking Glass Studio: an array of {"filename": ...}. Also a
  /// currentlyPlaying.json, whose {"playlists": [{"path": ...}]} are M3U lists.
  [[nodiscard]] Playlist read_json(std::string_view text) const {
    const nlohmann::json root = optics::parse_json(text, name_);
    Playlist list{.name = name_, .items = {}, .standby = {}, .rounds = kForever};
    const nlohmann::json* entries = &root;
    const char* key = "filename";
    if (root.is_object()) {
      entries = &optics::JsonFields(root, name_).need("playlists");
      key = "path";
    }
    if (!entries->is_array() || entries->empty())
      throw input_error("{}: no list of files", name_)
          .remedy("expected [{\"filename\": \"city_qs8x6a0.75.png\"}]");
    toml::source_index number = 0;
    for (const nlohmann::json& entry : *entries) {
      const std::string file =
          optics::JsonFields(entry, fmt::format("{}{}{}", name_, before_place_, ++number))
              .text(key);
      std::vector<PlaylistItem> items;
      if (root.is_array())
        items.push_back(still_or_film(source(file, number)));
      else if (is_m3u_name(file))
        items = load_playlist(folder_ / located(file)).items;
      else
        fail_at(number, fmt::format("path: '{}' is not an M3U list", file.substr(0, 64)));
      if (list.items.size() + items.size() > kMaxPlaylistItems)
        fail_at(number, fmt::format("more than {} files", kMaxPlaylistItems));
      list.items.insert(list.items.end(), items.begin(), items.end());
    }
    return list;
  }
  /// Reads an M3U list: a file or its URI per line, after an optional "#EXTINF:SECONDS,TITLE".
  [[nodiscard]] Playlist read_m3u(std::string_view text) const {
    constexpr std::string_view kSeconds = "#EXTINF:";
    Playlist list{.name = name_, .items = {}, .standby = {}, .rounds = kForever};
    std::optional<double> still_s;
    if (text.starts_with(kByteOrderMark)) text.remove_prefix(kByteOrderMark.size());
    for (toml::source_index number = 1; !text.empty(); ++number) {
      std::string_view line = take_until(text, '\n');
      if (line.ends_with('\r')) line.remove_suffix(1);
      if (line.starts_with(kSeconds)) {
        std::string_view rest = line.substr(kSeconds.size());
        const auto seconds = take_number<double>(rest);  // 0 and -1: not stated
        if (seconds && *seconds > 0.0 && *seconds <= kMaxSeconds) still_s = *seconds;
      }
      if (line.empty() || line.starts_with('#')) continue;
      if (list.items.size() == kMaxPlaylistItems)
        fail_at(number, fmt::format("more than {} files", kMaxPlaylistItems));
      list.items.push_back(still_or_film(source(file_of_uri(line, number), number)));
      if (still_s) list.items.back().still_s = still_s;
      still_s.reset();
    }
    if (list.items.empty()) fail_at(1, "no file", "an M3U list has a file's name per line");
    return list;
  }

 private:
  [[noreturn]] void fail(const toml::node& node, const std::string& cause,
                         const std::string& remedy = {}) const {
    const bool named = key_.empty() || cause.starts_with(key_);
    fail_at(node.source().begin.line, named ? cause : fmt::format("{}: {}", key_, cause), remedy);
  }
  [[noreturn]] void fail_at(toml::source_index line, const std::string& cause,
                            const std::string& remedy = {}) const {
    throw input_error("{}{}{}: {}", name_, before_place_, std::max(line, 1u), cause).remedy(remedy);
  }
  [[nodiscard]] PlaylistItem item(const toml::node& node) const {
    const toml::table* const table = node.as_table();
    if (table == nullptr) fail(node, "not a table with a source");
    PlaylistItem item;
    ContentFlags content;
    for (const auto& [key, value] : *table) {
      if (key.str() == "rig")
        fail_at(key.source().begin.line, "rig: not allowed in a list, which is played on one panel",
                "use --rig instead");
      item_key(key.str(), value, item, content);
    }
    if (item.source.text.empty()) fail(node, "no source");
    item.source.content = std::move(content);
    if (item.duration_s && table->contains("loops"))
      fail(node, "loops and duration_s exclude each other");
    if (!table->contains("loops") && !item.duration_s) item.still_s = still_seconds(item.source);
    return item;
  }
  void item_key(std::string_view key, const toml::node& node, PlaylistItem& item,
                ContentFlags& content) const {
    key_ = key;
    try {
      if (key == "source")
        item.source = source(text(node), node.source().begin.line);
      else if (key == "loops")
        item.loops = loops(node);
      else if (key == "duration_s")
        item.duration_s = seconds(node);
      else if (key == "wait_s")
        item.wait_s = seconds(node);
      else if (key == "fps")
        item.rate = frames::parse_rate(text(node));
      else if (key == "frames")
        item.frames = parse_frame_range(text(node));
      else if (key == "cut")
        item.waits_until_primed = waits_until_primed(node);
      else if (key == "transition")
        item.transition = transition(node);
      else if (key == "transition_seconds")
        item.transition_s = seconds(node, kMaxTransitionSeconds);
      else if (key == "weight")
        item.weight = static_cast<uint64_t>(number(node, 1, int64_t{kMaxWeight}));
      else if (key == "fit")
        (void)frames::parse_picture_fit(item.fit = text(node));
      else if (key == "schedule")
        item.schedule = schedule(node);
      else if (key == "sound")
        item.sound = sound(node);
      else if (key == "volume")
        item.volume_db = decibels(node);
      else if (key == "overlay")
        item.overlays = overlays(node);
      else if (!layout_key(key, node, content))
        fail_at(node.source().begin.line, fmt::format("unknown key '{}'", key.substr(0, 64)),
                "an item has source, loops, duration_s, fps, frames, cut, transition, "
                "transition_seconds, sound, volume, overlay, wait_s, weight, fit, schedule, and "
                "the layout of its views: grid, stereo, depth...");
    } catch (const Error& error) {
      if (error.kind() == ErrorKind::Input) throw;
      std::string flag = fmt::format("--{} ", key);
      std::ranges::replace(flag, '_', '-');
      std::string_view cause = error.what();
      if (cause.starts_with(flag)) cause.remove_prefix(flag.size());
      fail(node, fmt::format("{}: {}", key, cause), error.hint());
    }
    key_.clear();
  }
  /// Reads a key that states how the views lie, as the flag of the same name does. Returns false
  /// for other keys.
  bool layout_key(std::string_view key, const toml::node& node, ContentFlags& content) const {
    const auto file = [&](const std::string& name) {
      return name.empty() || frames::parse_depth_layout(name) ? name : (folder_ / name).string();
    };
    const auto is_key = [key](const auto& named) { return named.first == key; };
    const auto* const words = std::ranges::find_if(kLayoutTexts, is_key);
    const auto* const flag = std::ranges::find_if(kLayoutSwitches, is_key);
    if (words != std::end(kLayoutTexts))
      content.*words->second = key == "depth" || key == "from_rig" ? file(text(node)) : text(node);
    else if (flag != std::end(kLayoutSwitches))
      content.*flag->second = truth(node);
    else if (key == "views")
      content.views = static_cast<int>(number(node, 1, frames::kMaxViews));
    else if (key == "aspect")
      content.aspect = positive(node);
    else if (key == "depth_budget")
      content.depth_budget = positive(node);
    else
      return false;
    check_layout(content);
    return true;
  }
  [[nodiscard]] static PlaylistItem still_or_film(SourceSpec source) {
    PlaylistItem item{.source = std::move(source)};
    item.still_s = still_seconds(item.source);
    return item;
  }
  /// Returns the file of a line: "file:///a%20b.png" is /a b.png. Other lines are names.
  [[nodiscard]] std::string file_of_uri(std::string_view line, toml::source_index number) const {
    constexpr std::string_view kLocal = "file://", kHost = "localhost/";
    if (line.find("://") == std::string_view::npos) return located(std::string(line));
    if (line.starts_with(kLocal)) {
      line.remove_prefix(kLocal.size());
      if (line.starts_with(kHost)) line.remove_prefix(kHost.size() - 1);
      if (line.starts_with('/')) return located(percent_decoded(line));
    }
    fail_at(number, "not a file of this computer", "copy the file, and write its name here");
  }
  /// Returns the path of a file. Lists on the storage of a display count from its root, which is a
  /// folder above the list.
  [[nodiscard]] std::string located(const std::string& name) const {
    const std::filesystem::path path(name);
    std::error_code error;
    if (!path.is_absolute() || std::filesystem::exists(path, error)) return name;
    for (auto above = std::filesystem::absolute(folder_, error); above.has_relative_path();
         above = above.parent_path())
      if (const auto file = above / path.relative_path(); std::filesystem::exists(file, error))
        return file.string();
    return name;
  }
  [[nodiscard]] SourceSpec source(const std::string& name, toml::source_index line) const {
    if (name.empty() || name.size() > kMaxSourceBytes || name.find('\0') != std::string::npos)
      fail_at(line, "source: not a valid name");
    try {
      const SourceSpec source = parse_source(name, {}, folder_);
      if (source.kind == SourceKind::List && !names_folder(source.text))
        fail_at(line, "source: a list cannot contain a list");
      if (source.kind == SourceKind::Live) (void)parse_capture(source.text);
      return source.in_folder(folder_);
    } catch (const Error& error) {
      if (error.kind() == ErrorKind::Input) throw;
      fail_at(line, error.what(), error.hint());
    }
  }
  [[nodiscard]] std::string text(const toml::node& node) const {
    if (const auto* const value = node.as_string()) return value->get();
    fail(node, "not a string in quotes");
  }
  [[nodiscard]] std::string sound(const toml::node& node) const {
    const std::string name = text(node);
    if (name.empty() || name.size() > kMaxSourceBytes || name.find('\0') != std::string::npos)
      fail(node, "sound: not a valid name", "name a file, or none");
    return name == "none" || name.front() == '/' ? name : (folder_ / name).string();
  }
  [[nodiscard]] double decibels(const toml::node& node) const {
    const auto value = node.is_number() ? node.value<double>() : std::nullopt;
    if (value && *value >= kLeastVolumeDb && *value <= kMostVolumeDb) return *value;
    fail(node, "not a number of decibels",
         fmt::format("write {} to {}; 0 leaves the sound as it is", kLeastVolumeDb, kMostVolumeDb));
  }
  [[nodiscard]] double seconds(const toml::node& node, double most = kMaxSeconds) const {
    const auto value = node.is_number() ? node.value<double>() : std::nullopt;
    if (value && *value > 0.0 && *value <= most) return *value;
    fail(node, "not a number of seconds", fmt::format("write more than 0, at most {}", most));
  }
  [[nodiscard]] TransitionKind transition(const toml::node& node) const {
    const auto* const name = std::ranges::find(kTransitionNames, text(node));
    if (name == kTransitionNames.end())
      fail(node, fmt::format("transition '{}': unknown", text(node).substr(0, 64)),
           "use cut, fade (through black) or cross (cross-fade)");
    return static_cast<TransitionKind>(name - kTransitionNames.begin());
  }
  /// Reads a key that stands before the items. Returns false for others. Sets `key_`.
  [[nodiscard]] bool takes_setting(Playlist& list, const std::string& key,
                                   const toml::node& node) const {
    key_ = key;
    if (key == "loop")
      list.rounds = loops(node);
    else if (key == "shuffle")
      list.shuffle = seed(node);
    else if (key == "transition")
      list.transition = transition(node);
    else if (key == "transition_seconds")
      list.transition_s = seconds(node, kMaxTransitionSeconds);
    else if (key == "sound")
      list.bed.file = sound(node) == "none" ? "" : sound(node);
    else if (key == "sound_volume")
      list.bed.volume_db = decibels(node);
    else if (key == "overlay")
      list.overlays = overlays(node);
    else
      key_.clear();
    return !key_.empty();
  }
  [[nodiscard]] std::vector<OverlaySpec> overlays(const toml::node& node) const {
    const toml::array* const array = node.as_array();
    if (array == nullptr || !(array->empty() || array->is_homogeneous<toml::table>()))
      fail(node, "overlay: not an array of tables", "write [[overlay]] or [[item.overlay]]");
    std::vector<OverlaySpec> overlays;
    for (const toml::node& one : *array) {
      nlohmann::json keys;
      for (const auto& [key, value] : *one.as_table())
        if (const auto* const words = value.as_string())
          keys[std::string(key.str())] = words->get();
        else
          keys[std::string(key.str())] = value.value<double>().value_or(NAN);
      try {
        overlays.push_back(parse_overlay(keys));
      } catch (const Error& error) {
        fail(one, fmt::format("overlay: {}", error.what()), error.hint());
      }
      std::string& file = overlays.back().content;
      if (overlays.back().kind == OverlaySpec::Kind::Picture) file = (folder_ / file).string();
    }
    return overlays;
  }
  void share_settings(const Playlist& list, PlaylistItem& item) const {
    item.bed = list.bed;
    item.overlays_of_list = list.overlays.size();
    item.overlays.insert(item.overlays.begin(), list.overlays.begin(), list.overlays.end());
    if (item.overlays.size() > kMaxOverlays)
      fail_at(1,
              fmt::format("overlay: {} has {}, with those of the list", item.source.text,
                          item.overlays.size()),
              fmt::format("an item has at most {}", kMaxOverlays));
  }
  /// Refuses a duration of a cut. That of a list is allowed, for items that may be added.
  void check_transitions(const Playlist& list, const toml::table& root) const {
    for (size_t n = 0; n < list.items.size(); ++n)
      if (list.items[n].transition_s && list.transition_to(list.items[n]) == TransitionKind::Cut)
        fail(*root["item"][n]["transition_seconds"].node(),
             fmt::format("transition_seconds: {} follows by a cut, which takes no time",
                         list.items[n].source.text),
             "leave it out, or write transition = \"fade\" or \"cross\"");
  }
  [[nodiscard]] uint64_t loops(const toml::node& node) const {
    if (const auto* const word = node.as_string(); word != nullptr && word->get() == "forever")
      return kForever;
    const auto* const number = node.as_integer();
    if (number != nullptr && number->get() >= 1 && number->get() <= kMaxLoops)
      return static_cast<uint64_t>(number->get());
    fail(node, "not a number of loops", "write a number of 1 or more, or \"forever\"");
  }
  [[nodiscard]] int64_t number(const toml::node& node, int64_t least, int64_t most) const {
    const auto* const number = node.as_integer();
    if (number != nullptr && number->get() >= least && number->get() <= most) return number->get();
    fail(node, fmt::format("not a whole number from {} to {}", least, most));
  }
  [[nodiscard]] double positive(const toml::node& node) const {
    const auto value = node.is_number() ? node.value<double>() : std::nullopt;
    if (value && *value > 0.0 && std::isfinite(*value)) return *value;
    fail(node, "not a number above 0");
  }
  [[nodiscard]] bool truth(const toml::node& node) const {
    if (const auto* const value = node.as_boolean()) return value->get();
    fail(node, "neither true nor false");
  }
  /// Returns the seed of a shuffle: true stands for 1. None for false.
  [[nodiscard]] std::optional<uint64_t> seed(const toml::node& node) const {
    if (node.is_boolean()) return truth(node) ? std::optional<uint64_t>(1) : std::nullopt;
    return static_cast<uint64_t>(number(node, 0, kMaxLoops));
  }
  [[nodiscard]] bool waits_until_primed(const toml::node& node) const {
    const std::string cut = text(node);
    if (cut != "gapless" && cut != "primed")
      fail(node, fmt::format("cut '{}': unknown", cut.substr(0, 64)),
           "use gapless (starts with the next frame) or primed (starts when frames are decoded "
           "ahead)");
    return cut == "primed";
  }
  [[nodiscard]] Schedule schedule(const toml::node& node) const {
    const toml::table* const table = node.as_table();
    if (table == nullptr) fail(node, "schedule: not a table");
    Schedule schedule;
    for (const auto& [key, value] : *table) {
      key_ = key.str();
      if (key.str() == "days")
        schedule.days = days(value);
      else if (key.str() == "from")
        schedule.from_minute = minute(value);
      else if (key.str() == "to")
        schedule.to_minute = minute(value);
      else if (key.str() == "dates")
        schedule.dates = dates_or_fail(value);
      else if (key.str() == "except")
        schedule.except = dates(value);
      else
        fail_at(key.source().begin.line, fmt::format("unknown key '{}'", key.str().substr(0, 64)),
                "a schedule has days, from, to, dates and except");
    }
    key_.clear();
    if (schedule.from_minute == schedule.to_minute || schedule.from_minute == 24 * 60)
      fail(node, "schedule: from and to leave no time in between");
    return schedule;
  }
  [[nodiscard]] uint8_t days(const toml::node& node) const {
    const toml::array* const array = node.as_array();
    if (array == nullptr || array->empty())
      fail(node, "days: not a list of days", "for example [\"mon\", \"tue\"]");
    uint8_t bits = 0;
    for (const toml::node& one : *array) {
      const auto day = std::find(kWeekdays.begin(), kWeekdays.end(), text(one));
      if (day == kWeekdays.end()) fail(one, "not a day", "mon, tue, wed, thu, fri, sat or sun");
      bits = static_cast<uint8_t>(bits | (1u << (day - kWeekdays.begin())));
    }
    return bits;
  }
  /// An export of dates that went wrong does not permit every day.
  [[nodiscard]] std::vector<DateSpan> dates_or_fail(const toml::node& node) const {
    std::vector<DateSpan> spans = dates(node);
    if (spans.empty()) fail(node, "dates: there is none", "leave dates out to play on every day");
    return spans;
  }
  /// Reads a list of dates, or the name of a file with one in each line, before blanks and a "#".
  [[nodiscard]] std::vector<DateSpan> dates(const toml::node& node) const {
    std::vector<DateSpan> spans;
    const auto add = [&](std::string_view text, const std::string& place) {
      const auto span = parse_dates(text);
      if (!span)
        fail(node, fmt::format("{}'{}' is no date", place, text.substr(0, 64)),
             "for example \"2026-12-24\", \"2026-12-24..2027-01-06\", or \"12-24\" for every year");
      if (spans.size() == kMaxPlaylistItems)
        fail(node, fmt::format("more than {} dates", kMaxPlaylistItems));
      spans.push_back(*span);
    };
    if (const toml::array* const array = node.as_array()) {
      for (const toml::node& one : *array) add(text(one), "");
      return spans;
    }
    if (const auto one = parse_dates(text(node))) return {*one};
    const std::filesystem::path file = folder_ / text(node);
    const std::string lines = [&] {
      try {
        return read_text_file(file, kMaxPlaylistBytes);
      } catch (const Error& error) {
        fail(node, error.what(),
             "write a list of dates, or the name of a file with one in each line");
      }
    }();
    std::string_view rest = lines;
    if (rest.starts_with(kByteOrderMark)) rest.remove_prefix(kByteOrderMark.size());
    for (int line = 1; !rest.empty(); ++line) {
      std::string_view text = take_until(rest, '\n');
      text = text.substr(0, text.find('#'));
      text = text.substr(0, text.find_last_not_of(" \t\r") + 1);
      text.remove_prefix(std::min(text.size(), text.find_first_not_of(" \t")));
      if (!text.empty()) add(text, fmt::format("{}:{}: ", file.string(), line));
    }
    return spans;
  }
  /// Parses "08:30" to minutes since midnight; "24:00" is the end of the day.
  [[nodiscard]] int minute(const toml::node& node) const {
    const std::string clock = text(node);
    const auto time = numbers_from<unsigned, 2>(clock, ':');
    if (time && clock.size() == 5 && clock[2] == ':' && (*time)[1] < 60) {
      const unsigned all = (*time)[0] * 60 + (*time)[1];
      if (all <= 24 * 60) return static_cast<int>(all);
    }
    fail(node, "not a time of day", "for example \"08:30\"");
  }
  void items(const toml::node& node, Playlist& list) const {
    const toml::array* const array = node.as_array();
    if (array == nullptr) fail(node, "item: not an array of tables", "write [[item]]");
    if (array->size() > kMaxPlaylistItems)
      fail(node, fmt::format("item: more than {}", kMaxPlaylistItems));
    for (const toml::node& one : *array) list.items.push_back(item(one));
  }

  std::string name_;
  std::filesystem::path folder_;
  mutable std::string key_;  ///< the key that is being read, which errors name
  const char* before_place_ = is_json_name(name_) ? ": entry " : ":";
};

}  // namespace

// --- order and times ------------------------------------------------------------------------

LocalTime local_time_now() {
  const std::time_t now = std::time(nullptr);
  std::tm local{};
  localtime_r(&now, &local);
  using namespace std::chrono;
  return {.day = day_of(year(local.tm_year + 1900) / (local.tm_mon + 1) / local.tm_mday),
          .minute = local.tm_hour * 60 + local.tm_min};
}

int day_of(std::chrono::year_month_day date) {
  return static_cast<int>((std::chrono::sys_days(date) - kFirstMonday).count());
}

std::chrono::year_month_day date_of(int day) { return kFirstMonday + std::chrono::days(day); }

bool DateSpan::contains(int day) const {
  const std::chrono::year_month_day date = date_of(day);
  if (first.year() != kEveryYear) return first <= date && date <= last;
  const std::chrono::year_month_day here = kEveryYear / date.month() / date.day();
  return first <= last ? first <= here && here <= last : first <= here || here <= last;
}

std::optional<DateSpan> parse_dates(std::string_view text) {
  const auto date_from = [](std::string_view part) -> std::optional<std::chrono::year_month_day> {
    using namespace std::chrono;
    const size_t parts = static_cast<size_t>(std::ranges::count(part, '-')) + 1;
    if (part.size() != (parts == 2 ? 5 : 10)) return std::nullopt;
    const std::string whole = (parts == 2 ? "0000-" : "") + std::string(part);
    const auto numbers = numbers_from<unsigned, 3>(whole, '-');
    if (!numbers) return std::nullopt;
    const auto& [y, m, d] = *numbers;
    const year_month_day date = year(static_cast<int>(y)) / static_cast<int>(m) / d;
    // Year 0, which stands for every year, has a 29 February.
    return date.ok() && (parts == 2 || y != 0) ? std::optional(date) : std::nullopt;
  };
  const size_t dots = text.find("..");
  const auto first = date_from(text.substr(0, dots));
  const auto last = dots == std::string_view::npos ? first : date_from(text.substr(dots + 2));
  if (!first || !last || (first->year() == kEveryYear) != (last->year() == kEveryYear) ||
      (first->year() != kEveryYear && *last < *first))
    return std::nullopt;
  return DateSpan{*first, *last};
}

std::string to_string(const DateSpan& dates) {
  const auto text = [](std::chrono::year_month_day date) {
    const std::string year =
        date.year() == kEveryYear ? "" : fmt::format("{:04}-", int{date.year()});
    return fmt::format("{}{:02}-{:02}", year, unsigned{date.month()}, unsigned{date.day()});
  };
  return text(dates.first) + (dates.first == dates.last ? "" : ".." + text(dates.last));
}

bool Schedule::permits(LocalTime time) const {
  if (from_minute < to_minute)
    return begins_on(*this, time.day) && time.minute >= from_minute && time.minute < to_minute;
  const bool evening = begins_on(*this, time.day) && time.minute >= from_minute;
  const bool night = begins_on(*this, time.day - 1) && time.minute < to_minute;
  return evening || night;
}

std::optional<int> Schedule::minutes_until_begin(LocalTime now) const {
  for (int days = 0; days < kLongestSearchDays; ++days) {
    const int minutes = days * kMinutesPerDay + from_minute - now.minute;
    if (minutes >= 0 && begins_on(*this, now.day + days)) return minutes;
  }
  return std::nullopt;
}

bool Playlist::has_transitions() const {
  const auto blends = [this](const auto& item) {
    return transition_to(item) != TransitionKind::Cut;
  };
  return std::ranges::any_of(items, blends) || (standby && blends(*standby));
}

size_t Playlist::items_scheduled(LocalTime now) const {
  return static_cast<size_t>(std::ranges::count_if(
      items, [now](const PlaylistItem& item) { return item.permitted(now); }));
}

double still_seconds(const SourceSpec& source) {
  try {
    if (const auto sidecar = source.has_pictures() ? frames::read_sidecar_of(source.text)
                                                   : std::optional<frames::QuiltSidecar>())
      return std::min(sidecar->duration_s.value_or(kStillSeconds), kMaxSeconds);
  } catch (const Error&) {
    return kStillSeconds;  // reported when the item is opened
  }
  return kStillSeconds;
}

Playlist playlist_of(const SourceSpec& source, uint64_t rounds) {
  Playlist list{.name = source.text, .items = {}, .standby = {}, .rounds = 1};
  // Loops of the item itself are seamless; rounds of a list are not.
  list.items.push_back({.source = source, .loops = rounds});
  return list;
}

bool Playlist::in_round(size_t index, int64_t round) const {
  const uint64_t most = std::ranges::max(items, {}, &PlaylistItem::weight).weight;
  // The first of the lighter items is in round 0, the second in round 1, ...
  const auto lighter = static_cast<uint64_t>(
      std::count_if(items.begin(), items.begin() + static_cast<ptrdiff_t>(index),
                    [most](const PlaylistItem& item) { return item.weight < most; }));
  return (static_cast<uint64_t>(round) + lighter * (most - 1)) * items[index].weight % most <
         items[index].weight;
}

std::vector<size_t> Playlist::order(int64_t round) const {
  std::vector<size_t> order(items.size());
  std::iota(order.begin(), order.end(), size_t{0});
  if (!shuffle || items.size() < 3) return order;
  const auto shuffled = [&](int64_t of_round) {
    std::vector<size_t> all = order;
    for (size_t left = all.size(); left > 1; --left)
      std::swap(all[left - 1],
                all[mixed(mixed(*shuffle ^ mixed(static_cast<uint64_t>(of_round))) + left) % left]);
    return all;
  };
  // Exchanging the first two items leaves the last one in its place, so that the round after this
  // one need not know of it.
  const size_t before = shuffled(round - 1).back();
  order = shuffled(round);
  if (order.front() == before) std::swap(order[0], order[1]);
  return order;
}

ListPlace Playlist::beside(ListPlace from, int step) const {
  const std::vector<size_t> played = order(from.round);
  const auto item = std::ranges::find(played, from.index);
  if (step < 0 && item == played.begin()) return {order(from.round - 1).back(), from.round - 1};
  if (step < 0 || item + 1 != played.end()) return {item[step], from.round};
  if (shuffle && rounds == kForever) ++from.round;
  return {order(from.round).front(), from.round};
}

NextItem next_item(const Playlist& list, std::optional<size_t> after, int64_t rounds_done,
                   LocalTime now) {
  const size_t scheduled = list.items_scheduled(now);
  // The item that must not follow itself, or none.
  const size_t last = list.shuffle && scheduled > 1 ? after.value_or(SIZE_MAX) : SIZE_MAX;
  // Each item is in at least one of kMaxWeight rounds.
  const auto last_round = rounds_done + static_cast<int64_t>(kMaxWeight);
  for (int64_t round = rounds_done; round <= last_round && !list.items.empty(); ++round) {
    const std::vector<size_t> order = list.order(round);
    auto item = after ? std::ranges::find(order, *after) + 1 : order.begin();
    after.reset();
    for (; item != order.end(); ++item)
      if (list.items[*item].permitted(now) && list.in_round(*item, round) && *item != last)
        return {.kind = NextItem::Kind::Item, .index = *item, .rounds_done = round};
    if (list.rounds != kForever && round + 1 >= static_cast<int64_t>(list.rounds))
      return {.kind = NextItem::Kind::End, .index = 0, .rounds_done = round + 1};
    if (scheduled == 0) break;
  }
  return {.kind = NextItem::Kind::None, .rounds_done = rounds_done};
}

std::string reason_to_wait(const Playlist& list, LocalTime now) {
  if (list.items.empty()) return "no file to play yet";
  std::optional<int> wait;
  for (const PlaylistItem& item : list.items) {
    if (item.permitted(now)) return {};
    const auto own = item.schedule->minutes_until_begin(now);
    if (own) wait = std::min(wait.value_or(*own), *own);
  }
  if (!wait) return "no item is scheduled any more";
  const int begin = now.minute + *wait, day = now.day + begin / kMinutesPerDay;
  constexpr std::array<const char*, 7> kNames = {"Mon", "Tue", "Wed", "Thu", "Fri", "Sat", "Sun"};
  const std::string date =
      day - now.day < 7 ? "" : to_string(DateSpan{date_of(day), date_of(day)}) + " ";
  return fmt::format("no item is scheduled before {} {}{:02}:{:02}",
                     kNames.at(static_cast<size_t>(LocalTime{.day = day}.weekday())), date,
                     begin % kMinutesPerDay / 60, begin % 60);
}

// --- files ----------------------------------------------------------------------------------

Playlist parse_playlist(std::string_view text, const std::string& name,
                        const std::filesystem::path& folder) {
  const Reader reader(name, folder);
  if (is_json_name(name)) return reader.read_json(text);
  return is_m3u_name(name) ? reader.read_m3u(text) : reader.read(text);
}

Playlist load_playlist(const std::filesystem::path& file) {
  // Taken before reading, so that a change during reading is noticed.
  const FileMark mark = mark_of(file);
  Playlist list =
      parse_playlist(read_text_file(file, kMaxPlaylistBytes), file.string(), file.parent_path());
  list.file = mark;
  return list;
}

}  // namespace lenticule::player
