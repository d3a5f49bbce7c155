// SPDX-License-Identifier: Apache-2.0
// The lines that go over a player's control socket: requests, answers, events. docs/control.md is
// the contract.
#pragma once

#include <array>
#include <cstdint>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "base/error.h"

namespace lenticule::player {

enum class ControlVerb {
  Status,
  Load,
  Play,
  Pause,
  Seek,
  Next,
  Previous,
  Loop,
  Trim,
  Snapshot,
  Stats,
  Doctor,
  Subscribe,
  Quit,
};

inline constexpr size_t kMaxControlLine = 64u << 10;

struct ControlRequest {
  nlohmann::json id;  ///< a whole number, a short text, or null
  ControlVerb verb = ControlVerb::Status;
  std::string source{};             ///< load
  std::optional<uint64_t> frame{};  ///< load, seek
  std::optional<uint64_t> item{};   ///< load, seek
  uint64_t loops = 0;               ///< loop; 0 = for ever
  /// trim: to these numbers, or by them.
  std::optional<double> offset_lenses{};
  std::optional<double> pitch_relative{};
  bool relative = false;
  std::string file{};                             ///< snapshot
  std::optional<std::array<double, 3>> eye_mm{};  ///< snapshot
};

/// One line without its end. Throws Error(Usage) for whatever is no request: not JSON, an unknown
/// verb, a field that the verb has not, a value that makes no sense. `id` is that of the line as
/// far as it has one, also then.
[[nodiscard]] ControlRequest parse_control_request(std::string_view line, nlohmann::json& id);

/// One line with its end. Text that is no UTF-8 is replaced, not refused.
[[nodiscard]] std::string answer_line(const nlohmann::json& id, nlohmann::ordered_json body);
[[nodiscard]] std::string error_line(const nlohmann::json& id, const Error& error);
[[nodiscard]] std::string event_line(const nlohmann::ordered_json& event);

[[nodiscard]] const char* verb_name(ControlVerb verb);
/// None if there is none of that name.
[[nodiscard]] std::optional<ControlVerb> verb_of(std::string_view name);

}  // namespace lenticule::player
