// SPDX-License-Identifier: Apache-2.0
// choose_output finds the one connector that a request means, or the reason why there is not
// exactly one. It never guesses by taking the first connector.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "base/error.h"
#include "display/kms/device/connector.h"
#include "display/kms/probe/output_wish.h"

namespace lenticule::display {

struct OutputCandidate {
  std::string card;  ///< path of the card's node
  ConnectorInfo connector;
};

struct OutputChoice {
  std::optional<size_t> chosen;  ///< index of the candidate
  /// If none was chosen: the error, the remedy, and whether waiting for a panel may help.
  ErrorKind kind = ErrorKind::Device;
  std::string cause{};
  std::string remedy{};
  bool may_come = false;
  /// Connected candidates on the requested output, of any identity.
  std::vector<size_t> present{};
};

[[nodiscard]] OutputChoice choose_output(const OutputWish& wish,
                                         const std::vector<OutputCandidate>& candidates);

}  // namespace lenticule::display
