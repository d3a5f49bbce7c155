// SPDX-License-Identifier: Apache-2.0
// What the kernel says about one connector and the panel on it, copied out of libdrm.
#pragma once

#include <xf86drmMode.h>

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "display/kms/device/drm_properties.h"
#include "display/kms/device/edid.h"
#include "frames/rational.h"

namespace lenticule::display {

enum class Probe {
  Cached,  ///< what the kernel knows already
  Full,    ///< asks the panel: may take hundreds of milliseconds
};

struct ConnectorInfo {
  uint32_t id = 0;
  uint32_t type = 0;   ///< DRM_MODE_CONNECTOR_*
  std::string name{};  ///< "HDMI-A-1"
  bool connected = false;
  uint32_t width_mm = 0;
  uint32_t height_mm = 0;
  std::vector<drmModeModeInfo> modes{};
  uint32_t possible_crtcs = 0;  ///< bit n = CRTC n of the resources
  EdidReading edid{};
  bool non_desktop = false;
  bool tiled = false;
  bool link_bad = false;
  PropertyTable properties{};
};

/// None if the connector is gone (MST hubs come and go).
[[nodiscard]] std::optional<ConnectorInfo> read_connector(int fd, uint32_t id, Probe probe);
[[nodiscard]] std::vector<ConnectorInfo> read_connectors(int fd, Probe probe);

/// The driver's, or the EDID's, first choice.
[[nodiscard]] bool is_preferred(const drmModeModeInfo& mode);
/// The first of those, else the first of all; null if there is none.
[[nodiscard]] const drmModeModeInfo* preferred_mode(const std::vector<drmModeModeInfo>& modes);
/// Exact: pixel clock over pixels per frame. 0/1 for a mode without timings.
[[nodiscard]] frames::Rate refresh_of(const drmModeModeInfo& mode);
/// Same timings; names and types do not count.
[[nodiscard]] bool same_timings(const drmModeModeInfo& a, const drmModeModeInfo& b);
/// "3840x2160@60" with the exact rate in hertz
[[nodiscard]] std::string to_string(const drmModeModeInfo& mode);

/// "HDMI-A-1 on /dev/dri/card1: connected, LGD 0x1234 ..., 3840x2160@59.997"
[[nodiscard]] std::string describe(const ConnectorInfo& connector, const std::string& card);

}  // namespace lenticule::display
