// SPDX-License-Identifier: Apache-2.0
// PlayList reads the list that the player plays, and writes changed versions of its file, which the
// player follows. A version that the player cannot play is replaced by the one before.
#pragma once

#include <filesystem>
#include <functional>
#include <mutex>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <vector>

#include "apps/lenticule-web/link/control_link.h"
#include "apps/lenticule-web/link/player_state.h"

namespace lenticule::web {

/// Returns the text of a playlist file with the keys of `list`: loop, default, items. Throws
/// HttpError 422 for a key or a value that a list does not have; the player checks the rest.
[[nodiscard]] std::string list_toml(const nlohmann::ordered_json& list);

/// Returns why a file does not play on this panel; empty if it does, none if it was not checked
/// before, and `checks` is false. Throws Error.
using ProblemOf =
    std::function<std::optional<std::string>(const std::filesystem::path& file, bool checks)>;

/// Thread safety: any thread.
class PlayList {
 public:
  /// `own_file` is the list that is written if the player plays no list; versions are kept in
  /// `versions`.
  PlayList(ControlLink& link, PlayerState& state, std::filesystem::path own_file,
           std::filesystem::path versions, ProblemOf problem_of);

  /// Returns {"file", "version", "editable", "by_hand", "loop", "default", "items"}; `by_hand` if
  /// the file has comments and an order that replace() does not keep. A folder that plays, and a
  /// list that cannot be read, are not editable.
  [[nodiscard]] nlohmann::ordered_json read();
  /// Writes the list, waits until the player uses it, and returns read(). A list that a text
  /// editor wrote becomes a version first. Throws HttpError 409 if `version` is not the present
  /// one, and 422 with the reason if the player cannot play the list or any item of it; the list
  /// before is then put back. "warnings" of the answer say which items will not play.
  nlohmann::ordered_json replace(const nlohmann::ordered_json& list, const std::string& version,
                                 const std::string& who);
  /// Returns the kept versions, newest first: {"versions": [{"name", "time", "who", "items"}]}.
  [[nodiscard]] nlohmann::ordered_json versions() const;
  /// Writes a kept version again, as replace() does.
  nlohmann::ordered_json restore(const std::string& name, const std::string& who);
  /// Returns true if the list, or the source that plays without one, names the file; a folder names
  /// none. Puts the name of the list into `list`.
  [[nodiscard]] bool names(const std::filesystem::path& file, std::string& list);

 private:
  [[nodiscard]] nlohmann::ordered_json ask_list();
  [[nodiscard]] nlohmann::ordered_json locked_read();
  nlohmann::ordered_json locked_write(const std::string& toml, const std::string& who,
                                      const nlohmann::ordered_json& now);
  [[nodiscard]] std::vector<std::string> problems_of(const nlohmann::ordered_json& list) const;
  void keep_other(const std::string& toml);
  void keep(const std::string& toml, const std::string& who);

  ControlLink& link_;
  PlayerState& state_;
  const std::filesystem::path own_file_;
  const std::filesystem::path versions_;
  const ProblemOf problem_of_;
  std::mutex mutex_;  ///< one change at a time
};

}  // namespace lenticule::web
