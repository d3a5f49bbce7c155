// SPDX-License-Identifier: Apache-2.0
// ConnectorInfo is the kernel's data about one connector and its panel, copied from libdrm.
#pragma once

#include <fmt/format.h>
#include <xf86drmMode.h>

#include <algorithm>
#include <cstdint>
#include <cstdlib>
#include <numeric>
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

/// The modes with 2160 lines or more; smaller ones do not need 4:2:0. vic, width, height, hertz,
/// pixel clock / 100 kHz
inline constexpr TelevisionMode kTelevisionModes[] = {
    {93, 3840, 2160, 24, 2970},    {94, 3840, 2160, 25, 2970},     {95, 3840, 2160, 30, 2970},
    {96, 3840, 2160, 50, 5940},    {97, 3840, 2160, 60, 5940},     {98, 4096, 2160, 24, 2970},
    {99, 4096, 2160, 25, 2970},    {100, 4096, 2160, 30, 2970},    {101, 4096, 2160, 50, 5940},
    {102, 4096, 2160, 60, 5940},   {103, 3840, 2160, 24, 2970},    {104, 3840, 2160, 25, 2970},
    {105, 3840, 2160, 30, 2970},   {106, 3840, 2160, 50, 5940},    {107, 3840, 2160, 60, 5940},
    {114, 3840, 2160, 48, 5940},   {115, 4096, 2160, 48, 5940},    {116, 3840, 2160, 48, 5940},
    {117, 3840, 2160, 100, 11880}, {118, 3840, 2160, 120, 11880},  {119, 3840, 2160, 100, 11880},
    {120, 3840, 2160, 120, 11880}, {121, 5120, 2160, 24, 3960},    {122, 5120, 2160, 25, 3960},
    {123, 5120, 2160, 30, 3960},   {124, 5120, 2160, 48, 7425},    {125, 5120, 2160, 50, 7425},
    {126, 5120, 2160, 60, 7425},   {127, 5120, 2160, 100, 14850},  {193, 5120, 2160, 120, 14850},
    {194, 7680, 4320, 24, 11880},  {195, 7680, 4320, 25, 11880},   {196, 7680, 4320, 30, 11880},
    {197, 7680, 4320, 48, 23760},  {198, 7680, 4320, 50, 23760},   {199, 7680, 4320, 60, 23760},
    {200, 7680, 4320, 100, 47520}, {201, 7680, 4320, 120, 47520},  {202, 7680, 4320, 24, 11880},
    {203, 7680, 4320, 25, 11880},  {204, 7680, 4320, 30, 11880},   {205, 7680, 4320, 48, 23760},
    {206, 7680, 4320, 50, 23760},  {207, 7680, 4320, 60, 23760},   {208, 7680, 4320, 100, 47520},
    {209, 7680, 4320, 120, 47520}, {210, 10240, 4320, 24, 14850},  {211, 10240, 4320, 25, 14850},
    {212, 10240, 4320, 30, 14850}, {213, 10240, 4320, 48, 29700},  {214, 10240, 4320, 50, 29700},
    {215, 10240, 4320, 60, 29700}, {216, 10240, 4320, 100, 59400}, {217, 10240, 4320, 120, 59400},
    {218, 4096, 2160, 100, 11880}, {219, 4096, 2160, 120, 11880},
};

/// Returns the exact refresh rate: pixel clock over pixels per frame. 0/1 for a mode without
/// timings.
[[nodiscard]] inline frames::Rate refresh_of(const drmModeModeInfo& mode) {
  int64_t numerator = int64_t{mode.clock} * 1000;
  int64_t denominator = int64_t{mode.htotal} * mode.vtotal;
  if ((mode.flags & DRM_MODE_FLAG_INTERLACE) != 0) numerator *= 2;
  if ((mode.flags & DRM_MODE_FLAG_DBLSCAN) != 0) denominator *= 2;
  if (mode.vscan > 1) denominator *= mode.vscan;
  if (numerator == 0 || denominator == 0) return {0, 1};
  const int64_t divisor = std::gcd(numerator, denominator);
  return {numerator / divisor, denominator / divisor};
}

inline bool same_mode(const drmModeModeInfo& mode, const TelevisionMode& listed) {
  // 1000/1001 differs by one in a thousand; the next rate by four in a hundred.
  constexpr double kTolerance = 0.0015;
  const double clock = mode.clock / 100.0 / listed.clock_mhz_x10;
  const double rate = refresh_of(mode).hertz() / listed.hertz;
  return mode.hdisplay == listed.width && mode.vdisplay == listed.height &&
         std::abs(clock - 1) < kTolerance && std::abs(rate - 1) < kTolerance;
}

/// Returns true if the mode has the size, rate and pixel clock of one of these, or 1000/1001 of
/// them.
[[nodiscard]] inline bool is_one_of(const drmModeModeInfo& mode, std::span<const uint8_t> vics) {
  return std::ranges::any_of(kTelevisionModes, [&](const TelevisionMode& listed) {
    return std::ranges::find(vics, listed.vic) != vics.end() && same_mode(mode, listed);
  });
}

enum class Probe {
  Cached,  ///< the kernel's cached data
  Full,    ///< queries the panel: may take hundreds of milliseconds
};

struct ConnectorInfo : ConnectorFacts {
  uint32_t id = 0;
  uint32_t type = 0;   ///< DRM_MODE_CONNECTOR_*
  std::string name{};  ///< "HDMI-A-1"
  std::vector<drmModeModeInfo> modes{};
  uint32_t possible_crtcs = 0;  ///< bit n = CRTC n of the resources
  EdidReading edid{};
  PropertyTable properties{};
};

inline std::string name_of(const drmModeConnector& connector) {
  const char* const type = drmModeGetConnectorTypeName(connector.connector_type);
  return fmt::format("{}-{}", type == nullptr ? "Unknown" : type, connector.connector_type_id);
}

/// Returns the connector; none if it is gone (MST hubs come and go).
[[nodiscard]] inline std::optional<ConnectorInfo> read_connector(int fd, uint32_t id, Probe probe) {
  const DrmConnector source(probe == Probe::Full ? drmModeGetConnector(fd, id)
                                                 : drmModeGetConnectorCurrent(fd, id));
  if (!source) return std::nullopt;
  auto properties = PropertyTable::read(fd, id, DRM_MODE_OBJECT_CONNECTOR);
  if (!properties) return std::nullopt;

  ConnectorInfo info;
  info.id = id;
  info.type = source->connector_type;
  info.name = name_of(*source);
  info.connected = source->connection == DRM_MODE_CONNECTED;
  info.width_mm = source->mmWidth;
  info.height_mm = source->mmHeight;
  info.possible_crtcs = drmModeConnectorGetPossibleCrtcs(fd, source.get());
  if (source->count_modes > 0)
    info.modes.assign(source->modes, source->modes + source->count_modes);
  info.edid = read_edid(read_blob(fd, static_cast<uint32_t>(properties->value("EDID"))));
  info.non_desktop = properties->value("non-desktop") != 0;
  if (const auto tile = static_cast<uint32_t>(properties->value("TILE")); tile != 0) {
    info.tiled = true;
    info.tile = parse_tile(read_blob(fd, tile));
  }
  info.variable_refresh = properties->value("vrr_capable") != 0;
  if (const Property* link = properties->find("link-status"))
    info.link_bad = link->value_named("Bad") == link->value;
  info.properties = std::move(*properties);
  return info;
}
[[nodiscard]] inline std::vector<ConnectorInfo> read_connectors(int fd, Probe probe) {
  std::vector<ConnectorInfo> connectors;
  const DrmResources resources(drmModeGetResources(fd));
  if (!resources) return connectors;
  for (int i = 0; i < resources->count_connectors; ++i)
    if (auto info = read_connector(fd, resources->connectors[i], probe);
        info && info->type != DRM_MODE_CONNECTOR_WRITEBACK)
      connectors.push_back(std::move(*info));
  return connectors;
}

/// Returns true for a connector type, DRM_MODE_CONNECTOR_*, of HDMI.
[[nodiscard]] inline bool is_hdmi(uint32_t type) {
  return type == DRM_MODE_CONNECTOR_HDMIA || type == DRM_MODE_CONNECTOR_HDMIB;
}

/// Returns true if the driver or the EDID marks the mode as preferred.
[[nodiscard]] inline bool is_preferred(const drmModeModeInfo& mode) {
  return (mode.type & DRM_MODE_TYPE_PREFERRED) != 0;
}
/// Returns the first preferred mode, else the first mode; null if there is none.
[[nodiscard]] inline const drmModeModeInfo* preferred_mode(
    const std::vector<drmModeModeInfo>& modes) {
  const auto found = std::ranges::find_if(modes, is_preferred);
  if (found != modes.end()) return &*found;
  return modes.empty() ? nullptr : &modes.front();
}
/// Returns true if the timings are equal; names and types are ignored.
[[nodiscard]] inline bool same_timings(const drmModeModeInfo& a, const drmModeModeInfo& b) {
  // The kernel reports the picture's aspect ratio only to clients that request it.
  constexpr uint32_t kTimingFlags = ~static_cast<uint32_t>(DRM_MODE_FLAG_PIC_AR_MASK);
  return a.clock == b.clock && a.hdisplay == b.hdisplay && a.hsync_start == b.hsync_start &&
         a.hsync_end == b.hsync_end && a.htotal == b.htotal && a.vdisplay == b.vdisplay &&
         a.vsync_start == b.vsync_start && a.vsync_end == b.vsync_end && a.vtotal == b.vtotal &&
         (a.flags & kTimingFlags) == (b.flags & kTimingFlags);
}
/// Returns "3840x2160@60" with the exact rate in hertz.
[[nodiscard]] inline std::string to_string(const drmModeModeInfo& mode) {
  return fmt::format("{}x{}@{:.6g}", mode.hdisplay, mode.vdisplay, refresh_of(mode).hertz());
}

/// Returns "HDMI-A-1 on /dev/dri/card1: connected, LGD 0x1234 ..., 3840x2160@59.997".
[[nodiscard]] inline std::string describe(const ConnectorInfo& connector, const std::string& card) {
  std::string text = fmt::format("{} on {}: ", connector.name, card);
  if (!connector.connected) return text + "nothing connected";
  text += connector.edid.identity
              ? to_string(*connector.edid.identity)
              : fmt::format("EDID {}", edid_problem_name(connector.edid.problem));
  if (const drmModeModeInfo* mode = preferred_mode(connector.modes))
    text += fmt::format(", {}", to_string(*mode));
  if (connector.non_desktop) text += ", not a desktop panel";
  if (connector.tiled) text += ", one tile of several";
  return text;
}

}  // namespace lenticule::display
