// SPDX-License-Identifier: Apache-2.0
// ShownInstead shows something else than the content for a while: a black frame, a test card, the
// numbered views or the chart of a calibration. For the player these are interruptions, after which
// it continues with its list at the same place.
#pragma once

#include <filesystem>
#include <nlohmann/json.hpp>
#include <string>

#include "apps/lenticule-web/link/control_link.h"

namespace lenticule::web {

/// Thread safety: any thread.
class ShownInstead {
 public:
  explicit ShownInstead(ControlLink& link) : link_(link) {}

  /// Shows "black", "card" or "views", or "content" again. Throws HttpError 400 for another word,
  /// 409 if there is no place to return to.
  void show(const std::string& what);
  /// Shows the chart of a calibration, a file of that name. Throws Error.
  void show_chart(const std::filesystem::path& file);
  /// Returns what is shown instead of the content according to the player's status, or an empty
  /// text.
  [[nodiscard]] static std::string shown(const nlohmann::ordered_json& status);

 private:
  void interrupt(const std::string& source);

  ControlLink& link_;
};

}  // namespace lenticule::web
