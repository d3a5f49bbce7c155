// SPDX-License-Identifier: Apache-2.0
// WebSite serves the pages and the HTTP API of a player. api/routes.cpp has the table of
// addresses.
#pragma once

#include <fcntl.h>
#include <fmt/format.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <chrono>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <map>
#include <memory>
#include <mutex>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "apps/lenticule-web/api/history.h"
#include "apps/lenticule-web/api/photo_calibration.h"
#include "apps/lenticule-web/api/pictures.h"
#include "apps/lenticule-web/api/play_list.h"
#include "apps/lenticule-web/api/routes.h"
#include "apps/lenticule-web/http/clock.h"
#include "apps/lenticule-web/http/message.h"
#include "apps/lenticule-web/http/parse.h"
#include "apps/lenticule-web/link/control_link.h"
#include "apps/lenticule-web/link/player_state.h"
#include "base/error_kinds.h"
#include "base/file.h"
#include "base/print.h"
#include "base/subprocess.h"
#include "base/temporary.h"
#include "base/text.h"
#include "base/unique_fd.h"

namespace lenticule::web {

struct MediaOptions {
  std::filesystem::path folder{};
  uint64_t largest_file = uint64_t{64} << 30;
  uint64_t keeps_free = uint64_t{1} << 30;  ///< bytes of the disk that uploads leave free
};

/// CheckMedia runs the player's own check of a file and returns its JSON. Throws Error.
using CheckMedia = std::function<nlohmann::ordered_json(const std::filesystem::path& file)>;

/// Thread safety: any thread. A file of which a part is being uploaded can have one sender.
class Media {
 public:
  /// The folder must exist.
  explicit Media(MediaOptions options, CheckMedia check)
      : options_(std::move(options)), check_(std::move(check)) {
    finish_replacements();
  }

  /// Returns the path of a file of that name, which need not exist. Throws HttpError 400.
  [[nodiscard]] std::filesystem::path path_of(const std::string& name) const {
    if (!is_media_name(name))
      throw HttpError(400, "this is not a name of a file",
                      "at most 120 bytes, without / and other special characters");
    if (name.ends_with(".toml")) throw HttpError(400, "lists are not uploaded", "use /api/v1/list");
    return options_.folder / name;
  }
  /// Returns {"files": [{"name", "bytes", "received", "earlier", "check"}], "free_bytes"};
  /// `received` is the size of an upload that is not complete, `earlier` that of the file which the
  /// present one replaced.
  [[nodiscard]] nlohmann::ordered_json list() const {
    std::vector<std::string> names;
    for (const auto& entry : std::filesystem::directory_iterator(options_.folder)) {
      std::string name = entry.path().filename().string();
      if (name.starts_with(kPart)) name = name.substr(std::string_view(kPart).size());
      if (!is_media_name(name) || name.ends_with(".toml") || !size_of(entry.path())) continue;
      if (std::find(names.begin(), names.end(), name) == names.end()) names.push_back(name);
      if (names.size() >= kMaxFiles) break;
    }
    std::sort(names.begin(), names.end(), NaturalOrder());
    ordered_json result = {{"files", ordered_json::array()}, {"free_bytes", free_bytes()}};
    for (const std::string& name : names) {
      try {
        result["files"].push_back(info(name));
      } catch (const HttpError&) {
        continue;  // removed meanwhile
      }
    }
    return result;
  }
  /// Returns one of them. Throws HttpError 404.
  [[nodiscard]] nlohmann::ordered_json info(const std::string& name) const {
    const std::filesystem::path file = path_of(name);
    const auto whole = size_of(file);
    const auto part = size_of(hidden(kPart, name));
    const auto earlier = size_of(hidden(kEarlier, name));
    if (!whole && !part) throw HttpError(404, name + ": there is no such file");
    ordered_json json = {{"name", name},
                         {"source", file.string()},
                         {"bytes", whole ? ordered_json(*whole) : ordered_json(nullptr)},
                         {"received", part ? ordered_json(*part) : ordered_json(nullptr)},
                         {"earlier", earlier ? ordered_json(*earlier) : ordered_json(nullptr)},
                         {"check", nullptr}};
    const std::lock_guard lock(mutex_);
    const auto checked = checked_.find(name);
    if (checked != checked_.end() && checked->second.mark == mark_of(file))
      json["check"] = checked->second.result;
    return json;
  }
  /// Returns the sink of an upload: of a whole file of `length` bytes, or of the part `range` that
  /// follows what was received. A file that exists is replaced if `replaces`, when the new one has
  /// passed the check. Throws HttpError 409 with the number of received bytes for another part, a
  /// second sender or a file that exists, 413 and 507 without room.
  [[nodiscard]] std::unique_ptr<BodySink> upload(const std::string& name,
                                                 std::optional<ByteRange> range,
                                                 std::optional<uint64_t> length, bool replaces) {
    const std::filesystem::path part = hidden(kPart, name);
    if (!replaces && size_of(path_of(name)))
      throw HttpError(409, name + ": there is a file of that name",
                      "replace it with ?replace=yes, or give the new file another name");
    if (range && length && range->bytes() != *length)
      throw HttpError(400, "Content-Range and Content-Length contradict each other");
    const uint64_t total = range ? range->total : length.value_or(0);
    if (total > options_.largest_file)
      throw HttpError(413, fmt::format("{}: larger than {} bytes", name, options_.largest_file));
    const uint64_t received = range && range->first > 0 ? size_of(part).value_or(0) : 0;
    if (range && range->first != received)
      throw HttpError(409, fmt::format("{}: {} bytes were received", name, received),
                      "continue behind them");
    if (free_bytes() < total - received)
      throw HttpError(507, name + ": the disk has no room for it", "delete other files first");
    {
      const std::lock_guard lock(mutex_);
      if (!uploading_.emplace(name, true).second)
        throw HttpError(409, name + ": is being uploaded by another connection", "wait for it");
    }
    const int flags =
        O_WRONLY | O_CREAT | O_CLOEXEC | O_NOFOLLOW | O_APPEND | (received == 0 ? O_TRUNC : 0);
    UniqueFd file(::open(part.c_str(), flags, 0644));
    if (!file) {
      release(name);
      fail_to_write(name);
    }
    const bool completes = !range || range->last + 1 == range->total;
    const auto expected = range ? std::optional(range->bytes()) : length;
    const uint64_t most = std::min(options_.largest_file, free_bytes());
    return std::make_unique<Upload>(*this, name, std::move(file), expected, most, completes);
  }
  /// Exchanges a file and the one that it replaced. Throws HttpError 404, and 422 with the reason
  /// if the earlier one does not play on this panel.
  void restore(const std::string& name) {
    const std::filesystem::path earlier = hidden(kEarlier, name);
    if (!size_of(earlier)) throw HttpError(404, name + ": there is no earlier file");
    put_in_place(earlier, name);
  }
  /// Removes a file with its earlier one, and an upload that is not complete. Throws HttpError 404,
  /// and 409 if a list of the folder names the file.
  void remove(const std::string& name) {
    const std::filesystem::path file = path_of(name);
    if (size_of(file))
      for (const auto& entry : std::filesystem::directory_iterator(options_.folder))
        if (entry.path().extension() == ".toml" && size_of(entry.path()) &&
            list_names(text_of_list(entry.path()), name))
          throw HttpError(
              409, fmt::format("{}: is in the list {}", name, entry.path().filename().string()),
              "remove it from the list first");
    const bool had_part = ::unlink(hidden(kPart, name).c_str()) == 0;
    const bool had_file = ::unlink(file.c_str()) == 0;
    (void)::unlink(hidden(kEarlier, name).c_str());
    if (!had_part && !had_file) throw HttpError(404, name + ": there is no such file");
  }
  /// Checks the file: {"plays", "problems", "figures", "duration"...}; the result of an earlier
  /// check is enough unless `again`. Waits for other checks, but not for ever. Throws HttpError.
  [[nodiscard]] nlohmann::ordered_json check(const std::string& name, bool again) {
    const std::filesystem::path file = path_of(name);
    if (!size_of(file)) throw HttpError(404, name + ": there is no such file");
    const FileMark mark = mark_of(file);
    const auto one = wait_for_checks();
    {
      const std::lock_guard lock(mutex_);
      const auto checked = checked_.find(name);
      if (!again && checked != checked_.end() && checked->second.mark == mark)
        return checked->second.result;
    }
    ordered_json result = check_(file);
    const std::lock_guard lock(mutex_);
    if (checked_.size() > kMaxFiles) checked_.clear();
    checked_[name] = {.mark = mark, .result = result};
    return result;
  }

 private:
  /// Upload writes one part behind those that were received.
  class Upload final : public BodySink {
   public:
    Upload(Media& media, std::string name, UniqueFd file, std::optional<uint64_t> expected,
           uint64_t most, bool completes)
        : media_(media),
          name_(std::move(name)),
          file_(std::move(file)),
          expected_(expected),
          most_(most),
          completes_(completes) {}
    ~Upload() override { media_.release(name_); }

    void take(std::span<const uint8_t> bytes) override {
      taken_ += bytes.size();
      if (expected_ && taken_ > *expected_)
        throw HttpError(413, name_ + ": more bytes than announced");
      if (taken_ > most_) {  // possible without a length, and therefore without a continuation
        (void)::unlink(media_.hidden(kPart, name_).c_str());
        throw HttpError(413, fmt::format("{}: larger than {} bytes", name_, most_),
                        "send a smaller file, or make room on the disk");
      }
      write_all(file_.get(), bytes, name_);
    }
    Response finish() override {
      if (expected_ && taken_ != *expected_)
        throw HttpError(400, name_ + ": fewer bytes than announced");
      if (completes_) {
        if (::fchmod(file_.get(), 0644) != 0 || ::fsync(file_.get()) != 0) fail_to_write(name_);
        media_.put_in_place(media_.hidden(kPart, name_), name_);
      }
      return json_response(media_.info(name_), completes_ ? 201 : 200);
    }

   private:
    Media& media_;
    const std::string name_;
    const UniqueFd file_;
    const std::optional<uint64_t> expected_;
    const uint64_t most_;
    const bool completes_;
    uint64_t taken_ = 0;
  };

  using ordered_json = nlohmann::ordered_json;
  static constexpr size_t kMaxFiles = 2000;
  static constexpr uint64_t kMaxListBytes = 1u << 20;
  static constexpr const char* kPart =
      ".upload-";  ///< begins the name of a file that is being uploaded
  static constexpr const char* kEarlier =
      ".earlier-";  ///< begins the name of a file that was replaced
  static constexpr const char* kKept =
      ".kept-";  ///< begins the name of a file while it is replaced
  /// Longest time to wait for other checks; with the check itself an answer stays in time.
  static constexpr auto kCheckWaits = std::chrono::seconds(20);

  static std::optional<uint64_t> size_of(const std::filesystem::path& file) {
    struct stat status {};
    if (::lstat(file.c_str(), &status) != 0 || !S_ISREG(status.st_mode)) return std::nullopt;
    return static_cast<uint64_t>(status.st_size);
  }

  /// Returns the text of a list; nothing if it cannot be read, which must not forbid deletions.
  static std::string text_of_list(const std::filesystem::path& list) {
    try {
      return read_text_file(list, kMaxListBytes);
    } catch (const Error& error) {
      say("web: {}; files that this list names can be deleted\n", error.what());
      return {};
    }
  }

  /// Returns true if a list names the file, in its own folder or with a whole path.
  static bool list_names(const std::string& toml, const std::string& name) {
    for (size_t at = toml.find(name); at != std::string::npos; at = toml.find(name, at + 1)) {
      const char after = at + name.size() < toml.size() ? toml[at + name.size()] : '\n';
      const char before = at > 0 ? toml[at - 1] : '\n';
      const size_t line = toml.rfind('\n', at) + 1;
      if ((after == '"' || after == '\'') && (before == '"' || before == '\'' || before == '/') &&
          toml[toml.find_first_not_of(" \t", line)] != '#')
        return true;
    }
    return false;
  }
  [[nodiscard]] std::filesystem::path hidden(const char* prefix, const std::string& name) const {
    (void)path_of(name);
    return options_.folder / (prefix + name);
  }
  /// Ends replacements that a crash interrupted: no file is lost, and none is left twice.
  void finish_replacements() const {
    for (const auto& entry : std::filesystem::directory_iterator(options_.folder)) {
      const std::string name = entry.path().filename().string();
      if (!name.starts_with(kKept)) continue;
      const std::string own = name.substr(std::string_view(kKept).size());
      const std::filesystem::path file = options_.folder / own;
      std::error_code error;
      if (!std::filesystem::exists(file, error))
        std::filesystem::rename(entry.path(), file, error);
      else if (std::filesystem::equivalent(entry.path(), file, error))
        std::filesystem::remove(entry.path(), error);
      else
        std::filesystem::rename(entry.path(), options_.folder / (kEarlier + own), error);
    }
  }
  /// Waits for the other checks. Throws HttpError 409 if they take too long.
  [[nodiscard]] std::unique_lock<std::timed_mutex> wait_for_checks() {
    std::unique_lock one(one_check_, AnswerTime::at_most(kCheckWaits));
    if (!one) throw HttpError(409, "other files are being checked", "try again in half a minute");
    return one;
  }
  /// Renames `from`, which replaces a file of that name only if it plays; the old file is kept.
  void put_in_place(const std::filesystem::path& from, const std::string& name) {
    const std::filesystem::path file = path_of(name);
    if (size_of(file)) {
      const auto one = wait_for_checks();
      const ordered_json result = check_(from);
      if (result["plays"] != true) {
        if (from == hidden(kPart, name)) (void)::unlink(from.c_str());
        const auto& problems = result["problems"];
        throw HttpError(422,
                        fmt::format("{}: the new file does not play on this panel: {}", name,
                                    problems.empty() ? "" : problems[0].get<std::string>()),
                        "the old file stays");
      }
      const std::filesystem::path kept = hidden(kKept, name);
      (void)::unlink(kept.c_str());
      // A file system without links has no file of that name for a moment.
      if (::link(file.c_str(), kept.c_str()) != 0 && ::rename(file.c_str(), kept.c_str()) != 0)
        fail_to_write(name);
      if (::rename(from.c_str(), file.c_str()) != 0 ||
          ::rename(kept.c_str(), hidden(kEarlier, name).c_str()) != 0)
        fail_to_write(name);
    } else if (::rename(from.c_str(), file.c_str()) != 0) {
      fail_to_write(name);
    }
    sync_folder_of(file);
  }
  [[nodiscard]] uint64_t free_bytes() const {
    std::error_code error;
    const std::filesystem::space_info space = std::filesystem::space(options_.folder, error);
    if (error || space.available <= options_.keeps_free) return 0;
    return space.available - options_.keeps_free;
  }
  void release(const std::string& name) {
    const std::lock_guard lock(mutex_);
    uploading_.erase(name);
  }

  const MediaOptions options_;
  const CheckMedia check_;
  mutable std::mutex mutex_;  ///< guards the two maps
  std::map<std::string, bool> uploading_;
  struct Checked {
    FileMark mark;
    nlohmann::ordered_json result;
  };
  std::map<std::string, Checked> checked_;
  std::timed_mutex one_check_;  ///< a check reads as fast as it can: one at a time
};

struct WebSiteOptions {
  std::string socket;               ///< the player's control socket
  std::filesystem::path state;      ///< folder of the server's own files
  MediaOptions media{};             ///< an empty folder: no list, no upload
  std::filesystem::path program{};  ///< lenticule, for the check of a file
  Clock* clock = &machine_clock();
};

class WebSite final : public Site {
 public:
  /// Throws Error if a folder cannot be used.
  explicit WebSite(WebSiteOptions options)
      : options_(std::move(options)),
        link_(options_.socket),
        player_(link_, *options_.clock),
        pictures_(link_),
        trims_(options_.state / "trims.json"),
        calibration_(link_, pictures_,
                     {.folder = options_.state / "calibration",
                      .program = options_.program,
                      .stops = [this] { return player_.stopped(); },
                      .history = options_.state / "rigs.json"},
                     *options_.clock) {
    MediaOptions media = options_.media;
    if (media.folder.empty()) return;
    if (!std::filesystem::is_directory(media.folder))
      throw usage_error("--media: no folder {}", media.folder.string())
          .remedy("make it, and give the server's user the right to write there");
    media.folder = std::filesystem::canonical(media.folder);
    media_ = std::make_unique<Media>(
        media, [this](const std::filesystem::path& file) { return check(file); });
    list_ = std::make_unique<PlayList>(
        link_, player_, media.folder / "list.toml", options_.state / "lists",
        [this](const std::filesystem::path& file, bool checks) -> std::optional<std::string> {
          const std::string name = file.filename();
          if (!is_media_name(name)) return std::nullopt;  // written into the list by hand
          const ordered_json result =
              checks ? media_->check(name, false) : media_->info(name)["check"];
          if (result.is_null()) return std::nullopt;
          const auto& problems = result["problems"];
          if (result["plays"] == true || problems.empty()) return "";
          return problems[0].get<std::string>();
        });
  }

  [[nodiscard]] Rights needed(const std::string& method, const std::string& path) const override {
    if (!asset_of(path).empty()) return Rights::None;
    const FoundRoute found = find_route(method, path);
    return found.route != nullptr ? found.route->rights : Rights::See;
  }
  [[nodiscard]] uint64_t largest_body(const std::string& method,
                                      const std::string& path) const override {
    const FoundRoute found = find_route(method, path);
    return found.route != nullptr ? found.route->largest_body : 0;
  }
  [[nodiscard]] std::unique_ptr<BodySink> sink(const Request& request) override {
    const FoundRoute found = find_route(request.method, request.path);
    if (found.route == nullptr || found.route->sink == nullptr) return nullptr;
    return found.route->sink({*this, request, found.name});
  }
  [[nodiscard]] Response answer(const Request& request) override {
    const FoundRoute found = find_route(request.method, request.path);
    if (found.route != nullptr) return found.route->answer({*this, request, found.name});
    if (found.other_method) throw HttpError(405, request.method + " is not possible here");
    const std::string_view asset = asset_of(request.path);
    if (!asset.empty() && (request.method == "GET" || request.method == "HEAD"))
      return page_response(asset, request);
    throw HttpError(404, "there is no such address",
                    "the API is described at /api/v1/openapi.json");
  }
  /// Ends the answers that continue; call it before the server ends.
  void stop() { player_.stop(); }

  [[nodiscard]] const Clock& clock() const { return *options_.clock; }
  [[nodiscard]] ControlLink& link() { return link_; }
  [[nodiscard]] PlayerState& player() { return player_; }
  [[nodiscard]] PictureMaker& pictures() { return pictures_; }
  [[nodiscard]] TrimHistory& trims() { return trims_; }
  [[nodiscard]] PhotoCalibration& calibration() { return calibration_; }
  /// Throw HttpError 404 without a media folder.
  [[nodiscard]] PlayList& list() {
    if (!list_) throw HttpError(404, "this server has no media folder", "start it with --media");
    return *list_;
  }
  [[nodiscard]] Media& media() {
    if (!media_) throw HttpError(404, "this server has no media folder", "start it with --media");
    return *media_;
  }

 private:
  using ordered_json = nlohmann::ordered_json;
  static constexpr auto kCheckTime = std::chrono::seconds(30);
  /// Lets the player's own program check the file, with the rig that is used now.
  [[nodiscard]] nlohmann::ordered_json check(const std::filesystem::path& file) {
    const TemporaryFolder folder(options_.state);
    const std::filesystem::path rig = folder.path() / "rig.toml";
    write_text_file(rig, pictures_.rig_toml());
    const ProgramRun run =
        run_and_capture({options_.program.string(), "play", file.string(), "--rig", rig.string(),
                         "--preflight", "--json"},
                        AnswerTime::at_most(kCheckTime), [this] { return player_.stopped(); });
    // The messages on standard error come before the JSON.
    const size_t begin = run.output.find("[\n");
    const ordered_json rows = begin == std::string::npos
                                  ? ordered_json()
                                  : ordered_json::parse(run.output.substr(begin), nullptr, false);
    // A machine that plays at the same time may read more slowly than it plays, so a slow file is a
    // warning.
    ordered_json result = {{"plays", run.exit_code == 0 || run.exit_code == 5},
                           {"too_slow", run.exit_code == 5},
                           {"problems", ordered_json::array()},
                           {"figures", nullptr}};
    if (rows.is_array() && rows.size() == 1 && rows[0].is_object()) {
      result["problems"] = rows[0].value("problems", ordered_json::array());
      result["figures"] = rows[0].value("figures", ordered_json());
    } else {
      result["problems"].push_back(run.timed_out ? "the check took too long"
                                                 : shortened(escaped(run.output), 400));
    }
    return result;
  }

  const WebSiteOptions options_;
  ControlLink link_;
  PlayerState player_;
  PictureMaker pictures_;
  TrimHistory trims_;
  PhotoCalibration calibration_;
  std::unique_ptr<Media> media_;
  std::unique_ptr<PlayList> list_;
};

}  // namespace lenticule::web
