// SPDX-License-Identifier: Apache-2.0
// ControlRequest and the functions below are the line protocol of a player's control socket:
// requests, answers, events. docs/play/control.md is the contract.
#pragma once

#include <array>
#include <chrono>
#include <cstdint>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "base/error_kinds.h"
#include "base/file.h"
#include "base/json_line_socket.h"
#include "player/playback/overlay.h"

namespace lenticule::player {

inline constexpr size_t kMaxControlLine = 64u << 10;

struct ControlRequest {
  nlohmann::json id;                ///< integer, short text, or null
  std::string_view verb{};          ///< one of those that the table of control.md lists
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
  /// overlay; none: "off"
  std::optional<OverlaySpec> overlay{};
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

/// ControlClient is a connection to the control socket of a player. Throws as JsonLineSocket does.
/// Thread safety: one thread.
class ControlClient : public JsonLineSocket {
 public:
  ControlClient(const std::string& socket, std::chrono::milliseconds timeout)
      : JsonLineSocket(
            socket, timeout,
            {.most_bytes = kMostBytes,
             .no_player = "start one: lenticule play SOURCE --rig RIG --control " + socket,
             .gone = {}}) {}

 private:
  /// Limit of an answer in bytes; answers of a player are far smaller.
  static constexpr size_t kMostBytes = 8u << 20;
};

/// Returns the socket of the only player that runs as a service on this machine. Throws
/// Error(Device) if there is none, Error(Usage) if there are several.
[[nodiscard]] inline std::string only_control_socket() {
  std::vector<std::string> found;
  for (const std::filesystem::path& folder : entries_of("/run/lenticule")) {
    std::error_code missing;
    if (is_socket(folder / "control.sock", missing)) found.push_back(folder / "control.sock");
  }
  if (found.size() == 1) return found.front();
  if (found.empty())
    throw Error(ErrorKind::Device, "--socket: no player service runs on this machine",
                "give the socket of a player: lenticule play ... --control SOCKET");
  throw usage_error("--socket: {} player services run on this machine", found.size())
      .remedy("give the socket of one: --socket " + found.front());
}

}  // namespace lenticule::player
