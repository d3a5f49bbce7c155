// SPDX-License-Identifier: Apache-2.0
#include "display/kms/device/connector.h"

#include <fmt/format.h>

#include <algorithm>
#include <numeric>

#include "display/kms/device/drm_handles.h"

namespace lenticule::display {
namespace {

std::string name_of(const drmModeConnector& connector) {
  const char* const type = drmModeGetConnectorTypeName(connector.connector_type);
  return fmt::format("{}-{}", type == nullptr ? "Unknown" : type, connector.connector_type_id);
}

}  // namespace

std::optional<ConnectorInfo> read_connector(int fd, uint32_t id, Probe probe) {
  const DrmConnector source(probe == Probe::Full ? drmModeGetConnector(fd, id)
                                                 : drmModeGetConnectorCurrent(fd, id));
  if (!source) return std::nullopt;
  auto properties = PropertyTable::read(fd, id, DRM_MODE_OBJECT_CONNECTOR);
  if (!properties) return std::nullopt;

  ConnectorInfo info{.id = id,
                     .type = source->connector_type,
                     .name = name_of(*source),
                     .connected = source->connection == DRM_MODE_CONNECTED,
                     .width_mm = source->mmWidth,
                     .height_mm = source->mmHeight,
                     .possible_crtcs = drmModeConnectorGetPossibleCrtcs(fd, source.get())};
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

std::vector<ConnectorInfo> read_connectors(int fd, Probe probe) {
  std::vector<ConnectorInfo> connectors;
  const DrmResources resources(drmModeGetResources(fd));
  if (!resources) return connectors;
  for (int i = 0; i < resources->count_connectors; ++i)
    if (auto info = read_connector(fd, resources->connectors[i], probe);
        info && info->type != DRM_MODE_CONNECTOR_WRITEBACK)
      connectors.push_back(std::move(*info));
  return connectors;
}

bool is_hdmi(uint32_t type) {
  return type == DRM_MODE_CONNECTOR_HDMIA || type == DRM_MODE_CONNECTOR_HDMIB;
}

bool is_preferred(const drmModeModeInfo& mode) {
  return (mode.type & DRM_MODE_TYPE_PREFERRED) != 0;
}

const drmModeModeInfo* preferred_mode(const std::vector<drmModeModeInfo>& modes) {
  const auto found = std::find_if(modes.begin(), modes.end(), is_preferred);
  if (found != modes.end()) return &*found;
  return modes.empty() ? nullptr : &modes.front();
}

frames::Rate refresh_of(const drmModeModeInfo& mode) {
  int64_t numerator = int64_t{mode.clock} * 1000;
  int64_t denominator = int64_t{mode.htotal} * mode.vtotal;
  if ((mode.flags & DRM_MODE_FLAG_INTERLACE) != 0) numerator *= 2;
  if ((mode.flags & DRM_MODE_FLAG_DBLSCAN) != 0) denominator *= 2;
  if (mode.vscan > 1) denominator *= mode.vscan;
  if (numerator == 0 || denominator == 0) return {0, 1};
  const int64_t divisor = std::gcd(numerator, denominator);
  return {numerator / divisor, denominator / divisor};
}

bool same_timings(const drmModeModeInfo& a, const drmModeModeInfo& b) {
  // The kernel reports the picture's aspect ratio only to clients that request it.
  constexpr uint32_t kTimingFlags = ~static_cast<uint32_t>(DRM_MODE_FLAG_PIC_AR_MASK);
  return a.clock == b.clock && a.hdisplay == b.hdisplay && a.hsync_start == b.hsync_start &&
         a.hsync_end == b.hsync_end && a.htotal == b.htotal && a.vdisplay == b.vdisplay &&
         a.vsync_start == b.vsync_start && a.vsync_end == b.vsync_end && a.vtotal == b.vtotal &&
         (a.flags & kTimingFlags) == (b.flags & kTimingFlags);
}

std::string to_string(const drmModeModeInfo& mode) {
  return fmt::format("{}x{}@{:.6g}", mode.hdisplay, mode.vdisplay, refresh_of(mode).hertz());
}

std::string describe(const ConnectorInfo& connector, const std::string& card) {
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
