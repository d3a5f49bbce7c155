// SPDX-License-Identifier: Apache-2.0
// Copies a connector's facts into a struct without libdrm's types, for use outside this folder.
#pragma once

#include <string>

#include "display/kms/device/connector.h"
#include "display/kms/survey/inspect.h"

namespace lenticule::display {

[[nodiscard]] PanelFacts panel_facts(const ConnectorInfo& connector, const std::string& card);

}  // namespace lenticule::display
