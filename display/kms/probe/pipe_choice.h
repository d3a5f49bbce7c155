// SPDX-License-Identifier: Apache-2.0
// Chooses the CRTC and the primary plane for a connector.
#pragma once

#include <cstdint>

#include "display/kms/device/connector.h"

namespace lenticule::display {

struct Pipe {
  uint32_t crtc = 0;
  int crtc_index = 0;
  uint32_t plane = 0;
};

/// Prefers the CRTC that already drives the connector (its mode can then be taken over without a
/// modeset), then an unused one. Throws Error(Device) if no CRTC with a primary plane for XRGB8888
/// can drive the connector.
[[nodiscard]] Pipe choose_pipe(int fd, const ConnectorInfo& connector);

}  // namespace lenticule::display
