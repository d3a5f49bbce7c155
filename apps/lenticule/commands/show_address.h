// SPDX-License-Identifier: Apache-2.0
// show_address shows the QR code of an address on the panel of a running player for a while.
#pragma once

#include <chrono>
#include <string>

#include "base/exit_code.h"
#include "player/control/control_client.h"

namespace lenticule::cli {

/// Returns the first line of standard input, an address. Throws Error(Usage) without one.
[[nodiscard]] std::string address_from_input();

/// Shows the code for `duration`, or until the process is interrupted, and then what was shown
/// before. Throws Error.
[[nodiscard]] ExitCode show_address(const std::string& socket, const std::string& address,
                                    std::chrono::milliseconds duration,
                                    std::chrono::milliseconds answer_time);

/// Returns the answer to the request. Throws the Error of an answer that is not ok, Error(Failed)
/// without an answer. Returns null if `stop_fd` became readable first.
[[nodiscard]] nlohmann::ordered_json ask(player::ControlClient& client,
                                         const nlohmann::ordered_json& request,
                                         std::chrono::milliseconds answer_time, int stop_fd);

}  // namespace lenticule::cli
