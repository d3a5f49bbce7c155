// SPDX-License-Identifier: Apache-2.0
// Is the panel there that is wanted, and if not, what is there instead?
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "base/error.h"
#include "display/kms/scanout/kms_display.h"
#include "display/kms/survey/inspect.h"

namespace lenticule::display {

struct PanelSearch {
  /// Exactly one panel fits, and has the mode: open_kms_display() would take it.
  bool found = false;
  /// Otherwise what it would throw. May list every candidate, one a line.
  Error refusal{ErrorKind::Device, ""};
  /// Whether a panel that comes could change that.
  bool may_come = true;
  /// Connected panels of the output that is wanted, whoever they are, by name. An output that is
  /// wanted by its EDID may be any.
  std::vector<PanelFacts> present{};
};

/// Asks every panel of every card, by the wish, refresh and session (which must be set) of
/// `options`. `lit` is a display of this process, whose card is asked through it; null if there is
/// none. Throws nothing but for lack of memory.
[[nodiscard]] PanelSearch search_panel(const KmsOptions& options, const KmsDisplay* lit = nullptr);

}  // namespace lenticule::display
