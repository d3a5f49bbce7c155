// SPDX-License-Identifier: Apache-2.0
// Which connector is meant: exactly one, or none and the reason. Never the first that happens to be
// there.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "base/error.h"
#include "display/kms/device/connector.h"
#include "display/kms/probe/output_wish.h"

namespace lenticule::display {

struct OutputCandidate {
  std::string card;  ///< path of its node
  ConnectorInfo connector;
};

struct OutputChoice {
  std::optional<size_t> chosen;  ///< index of the candidate
  /// Without one: what is wrong, what to do, and whether waiting for a panel may help.
  ErrorKind kind = ErrorKind::Device;
  std::string cause{};
  std::string remedy{};
  bool may_come = false;
  /// Connected candidates at the place that is meant, whoever they are.
  std::vector<size_t> present{};
};

[[nodiscard]] OutputChoice choose_output(const OutputWish& wish,
                                         const std::vector<OutputCandidate>& candidates);

}  // namespace lenticule::display
