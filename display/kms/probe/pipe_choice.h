// SPDX-License-Identifier: Apache-2.0
// Which CRTC and which primary plane feed the chosen connector.
#pragma once

#include <cstdint>

#include "display/kms/device/connector.h"

namespace lenticule::display {

struct Pipe {
  uint32_t crtc = 0;
  int crtc_index = 0;
  uint32_t plane = 0;
};

/// Prefers the CRTC that drives the connector already (its mode can then be taken over without a
/// flash), then one that drives nothing. Throws Error(Device) when no CRTC with a primary plane
/// for XRGB8888 can reach the connector.
[[nodiscard]] Pipe choose_pipe(int fd, const ConnectorInfo& connector);

}  // namespace lenticule::display
