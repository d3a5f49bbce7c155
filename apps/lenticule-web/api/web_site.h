// SPDX-License-Identifier: Apache-2.0
// WebSite serves the pages and the HTTP API of a player. api/routes.cpp has the table of
// addresses.
#pragma once

#include <filesystem>
#include <memory>
#include <optional>
#include <string>

#include "apps/lenticule-web/api/history.h"
#include "apps/lenticule-web/api/media.h"
#include "apps/lenticule-web/api/photo_calibration.h"
#include "apps/lenticule-web/api/pictures.h"
#include "apps/lenticule-web/api/play_list.h"
#include "apps/lenticule-web/http/clock.h"
#include "apps/lenticule-web/http/message.h"
#include "apps/lenticule-web/link/control_link.h"
#include "apps/lenticule-web/link/player_state.h"

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
  explicit WebSite(WebSiteOptions options);

  [[nodiscard]] Rights needed(const std::string& method, const std::string& path) const override;
  [[nodiscard]] uint64_t largest_body(const std::string& method,
                                      const std::string& path) const override;
  [[nodiscard]] std::unique_ptr<BodySink> sink(const Request& request) override;
  [[nodiscard]] Response answer(const Request& request) override;
  /// Ends the answers that continue; call it before the server ends.
  void stop() { player_.stop(); }

  [[nodiscard]] const Clock& clock() const { return *options_.clock; }
  [[nodiscard]] ControlLink& link() { return link_; }
  [[nodiscard]] PlayerState& player() { return player_; }
  [[nodiscard]] PictureMaker& pictures() { return pictures_; }
  [[nodiscard]] TrimHistory& trims() { return trims_; }
  [[nodiscard]] PhotoCalibration& calibration() { return calibration_; }
  /// Throw HttpError 404 without a media folder.
  [[nodiscard]] PlayList& list();
  [[nodiscard]] Media& media();

 private:
  [[nodiscard]] nlohmann::ordered_json check(const std::filesystem::path& file);

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
