// SPDX-License-Identifier: Apache-2.0
// ConnectorInfo is the kernel's data about one connector and its panel, copied from libdrm.
#pragma once

#include <xf86drmMode.h>

#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "display/kms/device/drm_properties.h"
#include "display/kms/device/edid.h"
#include "frames/rational.h"

namespace lenticule::display {

/// TelevisionMode is a mode with a number of CTA-861 (VIC), which a sink may accept as YCbCr 4:2:0
/// only.
struct TelevisionMode {
  uint8_t vic = 0;
  int width = 0;
  int height = 0;
  int hertz = 0;
  int clock_mhz_x10 = 0;  ///< pixel clock in units of 100 kHz
};

/// Returns the modes with 2160 lines or more; smaller ones do not need 4:2:0.
[[nodiscard]] std::span<const TelevisionMode> television_modes();

/// Returns true if the mode has the size, rate and pixel clock of one of these, or 1000/1001 of
/// them.
[[nodiscard]] bool is_one_of(const drmModeModeInfo& mode, std::span<const uint8_t> vics);

enum class Probe {
  Cached,  ///< the kernel's cached data
  Full,    ///< queries the panel: may take hundreds of milliseconds
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
  bool tiled = false;          ///< the panel has further connectors
  std::optional<Tile> tile{};  ///< set if tiled, unless the kernel's text is not valid
  bool link_bad = false;
  bool variable_refresh = false;  ///< "vrr_capable": panel and link can vary the refresh
  PropertyTable properties{};
};

/// Returns the connector; none if it is gone (MST hubs come and go).
[[nodiscard]] std::optional<ConnectorInfo> read_connector(int fd, uint32_t id, Probe probe);
[[nodiscard]] std::vector<ConnectorInfo> read_connectors(int fd, Probe probe);

/// Returns true for a connector type, DRM_MODE_CONNECTOR_*, of HDMI.
[[nodiscard]] bool is_hdmi(uint32_t type);

/// Returns true if the driver or the EDID marks the mode as preferred.
[[nodiscard]] bool is_preferred(const drmModeModeInfo& mode);
/// Returns the first preferred mode, else the first mode; null if there is none.
[[nodiscard]] const drmModeModeInfo* preferred_mode(const std::vector<drmModeModeInfo>& modes);
/// Returns the exact refresh rate: pixel clock over pixels per frame. 0/1 for a mode without
/// timings.
[[nodiscard]] frames::Rate refresh_of(const drmModeModeInfo& mode);
/// Returns true if the timings are equal; names and types are ignored.
[[nodiscard]] bool same_timings(const drmModeModeInfo& a, const drmModeModeInfo& b);
/// Returns "3840x2160@60" with the exact rate in hertz.
[[nodiscard]] std::string to_string(const drmModeModeInfo& mode);

/// Returns "HDMI-A-1 on /dev/dri/card1: connected, LGD 0x1234 ..., 3840x2160@59.997".
[[nodiscard]] std::string describe(const ConnectorInfo& connector, const std::string& card);

}  // namespace lenticule::display
