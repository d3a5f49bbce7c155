// SPDX-License-Identifier: Apache-2.0
// What is told about a connector outside of this folder: copied, without libdrm's types.
#pragma once

#include <string>

#include "display/kms/device/connector.h"
#include "display/kms/survey/inspect.h"

namespace lenticule::display {

[[nodiscard]] PanelFacts panel_facts(const ConnectorInfo& connector, const std::string& card);

}  // namespace lenticule::display
