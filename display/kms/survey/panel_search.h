// SPDX-License-Identifier: Apache-2.0
// Finds the requested panel among all connectors, or lists the connected ones and the reason why
// none matches.
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "base/error.h"
#include "display/kms/scanout/kms_display.h"
#include "display/kms/survey/inspect.h"

namespace lenticule::display {

struct PanelSearch {
  /// Exactly one panel matches and has the mode: open_kms_display() would open it.
  bool found = false;
  /// If not found: the error that open_kms_display() would throw. May list every candidate, one per
  /// line.
  Error refusal{ErrorKind::Device, ""};
  /// True if a panel that is connected later could match.
  bool may_come = true;
  /// Connected panels on the requested output, of any identity, by name. All panels for a request
  /// by EDID.
  std::vector<PanelFacts> present{};
};

/// Probes every connector of every card, using the request, refresh and session (which must be set)
/// of `options`. `lit` is an open display of this process, whose card is probed through it; null if
/// there is none. Throws only if memory is exhausted.
[[nodiscard]] PanelSearch search_panel(const KmsOptions& options, const KmsDisplay* lit = nullptr);

}  // namespace lenticule::display
