// SPDX-License-Identifier: Apache-2.0
// WebSite serves the pages and the HTTP API of a player. api/routes.cpp has the table of
// addresses.
#pragma once

#include <chrono>
#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <utility>

#include "apps/lenticule-web/api/history.h"
#include "apps/lenticule-web/api/media.h"
#include "apps/lenticule-web/api/photo_calibration.h"
#include "apps/lenticule-web/api/pictures.h"
#include "apps/lenticule-web/api/play_list.h"
#include "apps/lenticule-web/api/routes.h"
#include "apps/lenticule-web/http/clock.h"
#include "apps/lenticule-web/http/message.h"
#include "apps/lenticule-web/http/parse.h"
#include "apps/lenticule-web/link/control_link.h"
#include "apps/lenticule-web/link/player_state.h"
#include "base/error.h"
#include "base/file.h"
#include "base/subprocess.h"
#include "base/temporary.h"
#include "base/text.h"

namespace lenticule::web {

struct WebSiteOptions {
  std::string socket;           ///< the player's control socket
  std::filesystem::path state;  ///< folder of the server's own files
  std::optional<std::filesystem::path>
      media{};  ///< folder of the content; none: no list, no upload
  uint64_t largest_file = uint64_t{64} << 30;
  uint64_t keeps_free = uint64_t{1} << 30;
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
    if (!options_.media) return;
    if (!std::filesystem::is_directory(*options_.media))
      throw Error(ErrorKind::Usage, "--media: no folder " + options_.media->string(),
                  "make it, and give the server's user the right to write there");
    const std::filesystem::path folder = std::filesystem::canonical(*options_.media);
    media_ =
        std::make_unique<Media>(MediaOptions{.folder = folder,
                                             .largest_file = options_.largest_file,
                                             .keeps_free = options_.keeps_free},
                                [this](const std::filesystem::path& file) { return check(file); });
    list_ = std::make_unique<PlayList>(
        link_, player_, folder / "list.toml", options_.state / "lists",
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
