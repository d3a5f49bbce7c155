// SPDX-License-Identifier: Apache-2.0
// ControlRequest and the functions below are the line protocol of a player's control socket:
// requests, answers, events. docs/play/control.md is the contract.
#pragma once

#include <array>
#include <cstdint>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <string_view>

#include "base/error.h"

namespace lenticule::player {

enum class ControlVerb {
  Status,
  Load,
  Interrupt,
  Back,
  Blank,
  Cue,
  Go,
  Play,
  Pause,
  Seek,
  Next,
  Previous,
  Loop,
  Speed,
  Power,
  Volume,
  Trim,
  Rig,
  Snapshot,
  Frame,
  List,
  Stats,
  Doctor,
  Subscribe,
  Quit,
};

inline constexpr size_t kMaxControlLine = 64u << 10;

struct ControlRequest {
  nlohmann::json id;  ///< integer, short text, or null
  ControlVerb verb = ControlVerb::Status;
  std::string source{};             ///< load, interrupt, cue
  std::optional<uint64_t> frame{};  ///< load, interrupt, cue, seek
  std::optional<uint64_t> item{};   ///< load, interrupt, cue, seek, list
  std::optional<double> seconds{};  ///< interrupt
  bool then_back = false;           ///< cue
  uint64_t loops = 0;               ///< loop; 0 = forever
  uint32_t speed_permille = 1000;   ///< speed
  bool on = true;                   ///< power
  double volume_db = 0.0;           ///< volume
  /// trim: absolute values, or increments if `relative`.
  std::optional<double> offset_lenses{};
  std::optional<double> pitch_relative{};
  bool relative = false;
  std::string rig_toml{};                         ///< rig
  std::string file{};                             ///< snapshot
  std::optional<std::array<double, 3>> eye_mm{};  ///< snapshot
  std::string panel{};                            ///< snapshot: a panel of a wall, by its name
};

/// Parses one line without its line end. Throws Error(Usage) if the line is not a valid request:
/// not JSON, an unknown verb, a field that the verb does not have, or a value out of range. Sets
/// `id` to the line's id as far as the line has one, also when it throws.
[[nodiscard]] ControlRequest parse_control_request(std::string_view line, nlohmann::json& id);

/// The functions below return one line with its line end. Invalid UTF-8 is replaced, not refused.
[[nodiscard]] std::string answer_line(const nlohmann::json& id, nlohmann::ordered_json body);
[[nodiscard]] std::string error_line(const nlohmann::json& id, const Error& error,
                                     bool conflict = false);
[[nodiscard]] std::string event_line(const nlohmann::ordered_json& event);

[[nodiscard]] const char* verb_name(ControlVerb verb);

}  // namespace lenticule::player
