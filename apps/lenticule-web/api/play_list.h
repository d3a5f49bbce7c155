// SPDX-License-Identifier: Apache-2.0
// PlayList reads the list that the player plays, and writes changed versions of its file, which the
// player follows. A version that the player cannot play is replaced by the one before.
#pragma once

#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <ctime>
#include <filesystem>
#include <functional>
#include <mutex>
#include <nlohmann/json.hpp>
#include <optional>
#include <set>
#include <string>
#include <string_view>
#include <vector>

#include "apps/lenticule-web/http/message.h"
#include "apps/lenticule-web/http/parse.h"
#include "apps/lenticule-web/link/control_link.h"
#include "apps/lenticule-web/link/player_state.h"
#include "base/error.h"
#include "base/file.h"
#include "base/text.h"

namespace lenticule::web {

/// Returns why a file does not play on this panel; empty if it does, none if it was not checked
/// before, and `checks` is false. Throws Error.
using ProblemOf =
    std::function<std::optional<std::string>(const std::filesystem::path& file, bool checks)>;

/// Thread safety: any thread.
class PlayList {
 public:
  /// Returns the text of a playlist file with the keys of `list`: loop, default, items. Throws
  /// HttpError 422 for a key or a value that a list does not have; the player checks the rest.
  [[nodiscard]] static std::string list_toml(const nlohmann::ordered_json& list) {
    if (!list.is_object()) refuse("not an object with items");
    std::string toml = std::string(kHead) + "format = 1\n";
    std::string standby, items;
    for (const auto& [key, value] : list.items()) {
      if (key == "loop" || key == "transition" || key == "transition_seconds" || key == "sound" ||
          key == "sound_volume") {
        const bool is_text = key == "transition" || key == "sound";
        const auto write = key == "loop" ? loops : is_text ? quoted : number;
        if (!value.is_null()) toml += key + " = " + write(key, value) + "\n";
      } else if (key == "shuffle") {
        if (value != false)
          toml += "shuffle = " + (value == true ? truth(key, value) : number(key, value)) + "\n";
      } else if (key == "overlay") {
        if (!value.empty()) toml += "overlay = " + overlays(key, value) + "\n";
      } else if (key == "default") {
        if (!value.is_null()) standby = "\n[default]\n" + item_toml(value);
      } else if (key == "items") {
        if (!value.is_array() || value.empty() || value.size() > kMaxItems)
          refuse("items: not a list of 1 to 1000 items");
        for (const ordered_json& item : value) items += "\n[[item]]\n" + item_toml(item);
      } else {
        refuse(fmt::format("unknown key '{}'", shortened(escaped(key), 60)));
      }
    }
    if (items.empty()) refuse("items: missing");
    toml += standby + items;
    if (toml.size() > kMaxListBytes) refuse("the list has more than 1 MiB");
    return toml;
  }

  /// `own_file` is the list that is written if the player plays no list; versions are kept in
  /// `versions`.
  PlayList(ControlLink& link, PlayerState& state, std::filesystem::path own_file,
           std::filesystem::path versions, ProblemOf problem_of)
      : link_(link),
        state_(state),
        own_file_(std::move(own_file)),
        versions_(std::move(versions)),
        problem_of_(std::move(problem_of)) {
    std::filesystem::create_directories(versions_);
  }

  /// Returns {"file", "version", "editable", "by_hand", "loop", "default", "items"}; `by_hand` if
  /// the file has comments and an order that replace() does not keep. A folder that plays, and a
  /// list that cannot be read, are not editable.
  [[nodiscard]] nlohmann::ordered_json read() {
    const std::lock_guard lock(mutex_);
    return locked_read();
  }
  /// Writes the list, waits until the player uses it, and returns read(). A list that a text
  /// editor wrote becomes a version first. Throws HttpError 409 if `version` is not the present
  /// one, and 422 with the reason if the player cannot play the list or any item of it; the list
  /// before is then put back. "warnings" of the answer say which items will not play.
  nlohmann::ordered_json replace(const nlohmann::ordered_json& list, const std::string& version,
                                 const std::string& who) {
    const std::string toml = list_toml(list);
    const std::vector<std::string> problems = problems_of(list);  // takes seconds: not locked
    const std::lock_guard lock(mutex_);
    const ordered_json now = locked_read();
    if (!version.empty() && now["version"] != version)
      throw HttpError(409, "the list was changed meanwhile", "read it again");
    require_own_sources(list, now, own_file_.parent_path());
    ordered_json result = locked_write(toml, who, now);
    result["warnings"] = problems;
    return result;
  }
  /// Returns the kept versions, newest first: {"versions": [{"name", "time", "who", "items"}]}.
  [[nodiscard]] nlohmann::ordered_json versions() const {
    std::vector<std::filesystem::path> kept = kept_versions();
    std::ranges::reverse(kept);
    ordered_json result = {{"versions", ordered_json::array()}};
    for (const std::filesystem::path& file : kept) {
      const std::string text = read_text_file(file, 2 * kMaxListBytes);
      const std::string head = text.substr(0, text.find('\n'));
      size_t items = 0;
      for (size_t at = text.find("[[item]]"); at != std::string::npos;
           at = text.find("[[item]]", at + 1))
        ++items;
      const size_t blank = head.find(' ', 2);
      result["versions"].push_back(
          {{"name", file.stem().string()},
           {"time", std::strtoll(head.c_str() + std::min<size_t>(2, head.size()), nullptr, 10)},
           {"who", blank == std::string::npos ? "" : head.substr(blank + 1)},
           {"items", items}});
    }
    return result;
  }
  /// Writes a kept version again, as replace() does.
  nlohmann::ordered_json restore(const std::string& name, const std::string& who) {
    if (name.empty() || name.find_first_not_of("0123456789") != std::string::npos)
      throw HttpError(404, "there is no version of that name");
    const std::filesystem::path file = versions_ / (name + ".toml");
    if (!std::filesystem::exists(file)) throw HttpError(404, "there is no version of that name");
    std::string toml = read_text_file(file, 2 * kMaxListBytes);
    toml.erase(0, toml.find('\n') + 1);
    const std::lock_guard lock(mutex_);
    return locked_write(toml, who, locked_read());
  }
  /// Returns true if the list, or the source that plays without one, names the file; a folder names
  /// none. Puts the name of the list into `list`.
  [[nodiscard]] bool names(const std::filesystem::path& file, std::string& name) {
    const ordered_json list = ask_list();
    const ordered_json own = list.value("file", ordered_json());
    name = own.is_string() ? own.get<std::string>() : "of one source";
    std::error_code error;
    if (std::filesystem::is_directory(name, error))
      return false;  // a file that is deleted leaves this list
    return std::ranges::any_of(files_of(list), [&file, &error](const std::string& one) {
      return std::filesystem::equivalent(one, file, error);
    });
  }

 private:
  using ordered_json = nlohmann::ordered_json;
  using seconds = std::chrono::seconds;
  static constexpr size_t kMaxItems = 1000;
  static constexpr size_t kMaxTextBytes = 4096;

  static constexpr size_t kMaxListBytes = size_t{1} << 20;
  static constexpr size_t kKeptVersions = 20;
  static constexpr std::string_view kHead = "# Written by lenticule-web.\n";
  /// Name of the list as it was before the first change; this version is never removed.
  static constexpr const char* kOriginal = "0.toml";
  /// The player looks for a replaced list every two or three seconds.
  static constexpr auto kPlayerNotices = seconds(8);
  /// Longest time for which the items of a new list are examined.
  static constexpr auto kLongestCheck = seconds(20);

  [[noreturn]] static void refuse(const std::string& what) {
    throw HttpError(422, what, "see the section \"Playlists\" of the documentation");
  }

  /// Returns the text as a basic string of TOML: that of JSON, but for DEL, which TOML forbids.
  static std::string quoted(const std::string& key, const ordered_json& value) {
    if (!value.is_string() || value.get_ref<const std::string&>().size() > kMaxTextBytes)
      refuse(key + ": not a text of at most 4096 bytes");
    std::string toml = value.dump();
    for (size_t at = 0; (at = toml.find('\x7f')) != std::string::npos;)
      toml.replace(at, 1, "\\u007F");
    return toml;
  }

  static std::string number(const std::string& key, const ordered_json& value) {
    if (!value.is_number()) refuse(key + ": not a number");
    return value.dump();
  }

  static std::string loops(const std::string& key, const ordered_json& value) {
    return value == "forever" ? "\"forever\"" : number(key, value);
  }

  static std::string truth(const std::string& key, const ordered_json& value) {
    if (!value.is_boolean()) refuse(key + ": neither true nor false");
    return value.dump();
  }
  static std::string texts(const std::string& key, const ordered_json& value) {
    if (!value.is_array() || value.size() > kMaxItems) refuse(key + ": not a list of texts");
    std::string toml = "[";
    for (const ordered_json& text : value)
      toml += (toml.size() > 1 ? ", " : "") + quoted(key, text);
    return toml + "]";
  }
  static std::string overlays(const std::string& key, const ordered_json& value) {
    if (!value.is_array() || value.size() > kMaxItems) refuse(key + ": not a list of overlays");
    std::string toml = "[";
    for (const ordered_json& overlay : value) {
      if (!overlay.is_object()) refuse(key + ": not a list of objects");
      toml += toml.size() > 1 ? ", {" : "{";
      for (const auto& [name, part] : overlay.items()) {
        if (name.find_first_not_of("abcdefghijklmnopqrstuvwxyz_") != std::string::npos)
          refuse(fmt::format("{}: unknown key '{}'", key, shortened(escaped(name), 60)));
        toml += (toml.back() == '{' ? "" : ", ") + name + " = " +
                (part.is_string() ? quoted(name, part) : number(name, part));
      }
      toml += "}";
    }
    return toml + "]";
  }
  static std::string schedule_toml(const ordered_json& schedule) {
    if (!schedule.is_object()) refuse("schedule: not an object");
    std::string toml = "[item.schedule]\n";
    for (const auto& [key, value] : schedule.items()) {
      if (key == "days" || key == "dates" || key == "except")
        toml += key + " = " + texts(key, value) + "\n";
      else if (key == "from" || key == "to")
        toml += key + " = " + quoted(key, value) + "\n";
      else
        refuse(fmt::format("schedule: unknown key '{}'", shortened(escaped(key), 60)));
    }
    return toml;
  }

  static std::string item_toml(const ordered_json& item) {
    if (!item.is_object() || !item.contains("source")) refuse("item: no source");
    static const std::set<std::string> kTexts = {
        "source", "fps",         "frames",         "cut",        "fit",      "grid",  "stereo",
        "depth",  "depth_range", "depth_distance", "zero_plane", "from_rig", "sound", "transition"};
    static const std::set<std::string> kNumbers = {
        "duration_s", "wait_s",       "weight", "views",
        "aspect",     "depth_budget", "volume", "transition_seconds"};
    static const std::set<std::string> kTruths = {"invert", "invert_depth", "reweave"};
    std::string toml, schedule;
    for (const auto& [key, value] : item.items()) {
      const auto write = kTexts.contains(key)     ? quoted
                         : kNumbers.contains(key) ? number
                         : kTruths.contains(key)  ? truth
                         : key == "loops"         ? loops
                         : key == "overlay"       ? overlays
                                                  : nullptr;
      if (write != nullptr)
        toml += key + " = " + write(key, value) + "\n";
      else if (key == "schedule")
        schedule = schedule_toml(value);
      else
        refuse(fmt::format("item: unknown key '{}'", shortened(escaped(key), 60)));
    }
    return toml + schedule;
  }

  /// Returns the sources and sounds of the list's items and the pictures of its overlays.
  static std::vector<std::string> files_of(const ordered_json& list) {
    std::vector<std::string> files;
    const auto add = [&files](const ordered_json& entry, const char* key) {
      const bool has = entry.is_object() && entry.contains(key) && entry[key].is_string();
      if (has) files.push_back(entry[key].get<std::string>());
    };
    const auto add_all = [&add](const ordered_json& entry) {
      add(entry, "source");
      add(entry, "sound");
      if (!entry.is_object() || !entry.contains("overlay")) return;
      for (const ordered_json& overlay : entry["overlay"]) add(overlay, "picture");
    };
    add_all(list);
    add_all(list.value("default", ordered_json()));
    for (const ordered_json& item : list["items"]) add_all(item);
    return files;
  }

  /// Throws HttpError 422 if a new item, sound or picture of an overlay is neither a file of the
  /// media folder nor made by the player. Those that the list has already may stay.
  static void require_own_sources(const ordered_json& list, const ordered_json& now,
                                  const std::filesystem::path& media) {
    std::vector<std::string> known = {"black", "card", "views", "none"};
    for (std::string& file : files_of(now)) known.push_back(std::move(file));
    for (const std::string& name : files_of(list)) {
      const std::filesystem::path file(name);
      const bool own = file.parent_path() == media && !name.ends_with(".toml") &&
                       is_media_name(file.filename().native());
      if (!own && std::find(known.begin(), known.end(), name) == known.end())
        refuse(fmt::format("source '{}': not a file of the media folder",
                           shortened(escaped(name), 100)));
    }
  }

  /// Returns the whole list of the player, which sends a long one in parts.
  [[nodiscard]] nlohmann::ordered_json ask_list() {
    ordered_json whole;
    size_t count = 0;
    do {
      const size_t seen = whole.is_null() ? 0 : whole["items"].size();
      ordered_json part = link_.ask({{"do", "list"}, {"item", seen}}).body;
      if (!part.contains("items") || !part["items"].is_array() || !part.contains("count") ||
          !part["count"].is_number_unsigned())
        throw Error(ErrorKind::Device, "list: the player's answer is not understood");
      count = part["count"].get<size_t>();
      if (part["items"].empty()) count = seen;  // the list became shorter meanwhile
      if (whole.is_null())
        whole = std::move(part);
      else
        for (ordered_json& item : part["items"]) whole["items"].push_back(std::move(item));
    } while (whole["items"].size() < count);
    return whole;
  }
  [[nodiscard]] nlohmann::ordered_json locked_read() {
    const ordered_json list = ask_list();
    ordered_json result = {
        {"file", list.value("file", ordered_json())},
        {"version", ""},
        {"editable", false},
        {"by_hand", false},
        {"loop", list.value("loop", ordered_json(1))},
        {"shuffle", list.value("shuffle", ordered_json(false))},
        {"transition", list.value("transition", ordered_json("cut"))},
        {"transition_seconds", list.value("transition_seconds", ordered_json(0.5))},
        {"sound", list.value("sound", ordered_json())},
        {"sound_volume", list.value("sound_volume", ordered_json(0.0))},
        {"overlay", list.value("overlay", ordered_json::array())},
        {"default", list.value("default", ordered_json())},
        {"items", list["items"]}};
    // A name that changes with the content.
    result["version"] = fmt::format("{:016x}", std::hash<std::string>()(json_text(result)));
    // Without a list, the source that plays becomes the first item of own_file_.
    const std::filesystem::path file =
        result["file"].is_string() ? std::filesystem::path(result["file"].get<std::string>())
                                   : own_file_;
    std::error_code error;
    // The page saves TOML.
    result["editable"] =
        lower_case(file.extension().string()) == ".toml" &&
        std::filesystem::equivalent(file.parent_path(), own_file_.parent_path(), error);
    if (result["editable"] == true && result["file"].is_string() &&
        std::filesystem::exists(file, error)) {
      try {
        result["by_hand"] = !read_text_file(file, kMaxListBytes).starts_with(kHead);
      } catch (const Error&) {
        // A folder, or a list that is too long or that the server may not read.
        result["editable"] = false;
      }
    }
    return result;
  }
  nlohmann::ordered_json locked_write(const std::string& toml, const std::string& who,
                                      const nlohmann::ordered_json& now) {
    const bool has_list = now["file"].is_string();
    const std::filesystem::path file =
        has_list ? std::filesystem::path(now["file"].get<std::string>()) : own_file_;
    std::error_code error;  // the server may not be allowed to look
    if (std::filesystem::is_directory(file, error))
      throw HttpError(409, "the player plays a folder, whose files are its list",
                      "add and delete files, or load a list");
    if (!now["editable"].get<bool>())
      throw HttpError(409,
                      "the list is no TOML, lies outside of the media folder, or cannot be read",
                      "save it as LIST.toml in the media folder, with its files");
    std::string before;
    if (has_list) {
      before = read_text_file(file, kMaxListBytes);
      keep_other(before);
    }
    const uint64_t newest = state_.newest();
    write_text_file(file, toml);
    std::filesystem::permissions(
        file, std::filesystem::perms::group_read | std::filesystem::perms::others_read,
        std::filesystem::perm_options::add);
    if (!has_list) {
      (void)link_.ask({{"do", "load"}, {"source", file.string()}}, kOpeningTime);
    } else if (before != toml) {
      std::string detail;
      const auto taken =
          state_.wait_for_either(newest, "replaced", "not_replaced", kPlayerNotices, detail);
      if (taken == false) {
        write_text_file(file, before);
        const ordered_json event = ordered_json::parse(detail, nullptr, false);
        const bool has_cause =
            event.is_object() && event.contains("cause") && event["cause"].is_string();
        throw HttpError(422,
                        "the player cannot play this list: " +
                            (has_cause ? event["cause"].get<std::string>() : detail),
                        "the version before was put back");
      }
    }
    keep(toml, who);
    state_.refresh();
    state_.publish("list", {{"who", who}});
    return locked_read();
  }
  /// Returns why items will not play, as far as that is known: files that are missing, or did not
  /// pass their last check. Files are checked until one plays. Throws HttpError 422 if none does.
  [[nodiscard]] std::vector<std::string> problems_of(const nlohmann::ordered_json& list) const {
    const auto end = std::chrono::steady_clock::now() + kLongestCheck;
    std::vector<std::string> problems;
    bool plays = false;
    for (const ordered_json& item : list["items"]) {
      const auto source = item["source"].get<std::string>();
      const std::filesystem::path file(source);
      std::optional<std::string> problem;  // none for folders and patterns, which are not examined
      std::error_code error;
      if (file.parent_path() != own_file_.parent_path())
        problem = "";  // made by the player, or from elsewhere
      else if (std::filesystem::is_regular_file(file, error))
        problem = problem_of_(file, !plays && std::chrono::steady_clock::now() < end);
      else if (!std::filesystem::exists(file, error) && source.find('%') == std::string::npos)
        problem = file.filename().string() + ": there is no such file";
      // A long list is not examined to its end: what is not known may play.
      plays = plays || !problem || problem->empty();
      if (problem && !problem->empty() && std::ranges::find(problems, *problem) == problems.end())
        problems.push_back(std::move(*problem));
    }
    if (!plays)
      throw HttpError(422, "the player cannot play any item of this list: " + problems.front(),
                      "the list stays as it was");
    return problems;
  }
  /// Returns the files of the kept versions: the original, then the oldest first.
  [[nodiscard]] std::vector<std::filesystem::path> kept_versions() const {
    std::vector<std::filesystem::path> kept = entries_of(versions_);
    std::erase_if(kept, [](const auto& file) { return file.extension() != ".toml"; });
    return kept;
  }
  /// Keeps a list that the server did not write last: the original, or one that was changed by
  /// hand.
  void keep_other(const std::string& toml) {
    const std::vector<std::filesystem::path> kept = kept_versions();
    const auto content = [](const std::string& text) { return text.substr(text.find('\n') + 1); };
    if (!kept.empty() && content(read_text_file(kept.back(), 2 * kMaxListBytes)) == toml) return;
    if (std::filesystem::exists(versions_ / kOriginal)) return keep(toml, "by hand");
    write_text_file(versions_ / kOriginal,
                    fmt::format("# {} by hand\n", std::time(nullptr)) + toml);
  }
  void keep(const std::string& toml, const std::string& who) {
    const auto now = std::chrono::duration_cast<std::chrono::milliseconds>(
                         std::chrono::system_clock::now().time_since_epoch())
                         .count();
    const std::string head = fmt::format("# {} {}\n", now / 1000, escaped(who));
    write_text_file(versions_ / fmt::format("{}.toml", now), head + toml);
    std::vector<std::filesystem::path> kept = kept_versions();
    std::erase(kept, versions_ / kOriginal);
    for (size_t k = 0; k + kKeptVersions < kept.size(); ++k) {
      std::error_code ignored;
      std::filesystem::remove(kept[k], ignored);
    }
  }

  ControlLink& link_;
  PlayerState& state_;
  const std::filesystem::path own_file_;
  const std::filesystem::path versions_;
  const ProblemOf problem_of_;
  std::mutex mutex_;  ///< one change at a time
};

}  // namespace lenticule::web
