// SPDX-License-Identifier: Apache-2.0
// Which connector is meant: exactly one, or none and the reason. Never the first that happens to be
// there.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "display/kms/connector.h"
#include "display/kms/output_key.h"
#include "frames/frame.h"
#include "optics/error.h"
#include "optics/rig.h"

namespace lenticule::display {

struct OutputCandidate {
  std::string card;  ///< path of its node
  ConnectorInfo connector;
};

enum class IdentityPolicy {
  Require,  ///< the panel must be the one that the rig was made for
  Ignore,   ///< for test cards and measurements: whatever panel is there
};

struct OutputWish {
  OutputKey key;
  optics::PanelIdentity identity;  ///< of the rig; empty = any
  frames::FrameGeometry panel;
  IdentityPolicy policy = IdentityPolicy::Require;
};

struct OutputChoice {
  std::optional<size_t> chosen;  ///< index of the candidate
  /// Without one: what is wrong, what to do, and whether waiting for a panel may help.
  ErrorKind kind = ErrorKind::Device;
  std::string cause{};
  std::string remedy{};
  bool may_come = false;
};

[[nodiscard]] OutputChoice choose_output(const OutputWish& wish,
                                         const std::vector<OutputCandidate>& candidates);

}  // namespace lenticule::display
