// SPDX-License-Identifier: Apache-2.0
#include "display/kms/probe/pipe.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <utility>

#include "base/error.h"
#include "display/kms/device/drm_format.h"
#include "display/kms/device/drm_handles.h"

namespace lenticule::display {
namespace {

// --- mode -----------------------------------------------------------------------------------

// A request for 60 matches 59.997 and does not match 59.94.
constexpr double kRefreshTolerance = 0.0005;

PixelSize size_of(const drmModeModeInfo& mode) {
  return {mode.hdisplay, mode.vdisplay};
}

double relative_error(const drmModeModeInfo& mode, frames::Rate refresh) {
  return std::abs(refresh_of(mode).hertz() / refresh.hertz() - 1.0);
}

/// Returns true if `a` is the better choice. If both are equally good, the one with the lower pixel
/// clock is better: it needs less link bandwidth, and is rarely a television timing with a limited
/// range of values.
bool better(const drmModeModeInfo& a, const drmModeModeInfo& b,
            std::optional<frames::Rate> refresh) {
  if (refresh) {
    const double difference = relative_error(a, *refresh) - relative_error(b, *refresh);
    if (std::abs(difference) > 1e-9) return difference < 0;
  }
  if (is_preferred(a) != is_preferred(b)) return is_preferred(a);
  const double faster = refresh_of(a).hertz() - refresh_of(b).hertz();
  if (std::abs(faster) > 1e-3) return faster > 0;
  return a.clock < b.clock;
}

std::optional<drmModeModeInfo> best_of_size(const std::vector<drmModeModeInfo>& modes,
                                            PixelSize size, std::optional<frames::Rate> refresh) {
  std::optional<drmModeModeInfo> best;
  for (const drmModeModeInfo& mode : modes) {
    if (size_of(mode) != size || !is_plain(mode)) continue;
    if (refresh && relative_error(mode, *refresh) > kRefreshTolerance) continue;
    if (!best || better(mode, *best, refresh)) best = mode;
  }
  return best;
}

std::string text_of(PixelSize size) {
  return fmt::format("{}x{}", size.width, size.height);
}

[[noreturn]] void throw_not_listed(const ConnectorInfo& connector, PixelSize size,
                                   std::optional<frames::Rate> refresh) {
  std::string wanted = text_of(size);
  if (refresh) wanted += fmt::format("@{}", frames::to_string(*refresh));
  std::string text = fmt::format("{}: no progressive mode {}; it has", connector.name, wanted);
  for (const drmModeModeInfo& mode : connector.modes) text += fmt::format(" {}", to_string(mode));
  if (connector.modes.empty()) text += " none";
  throw Error(ErrorKind::Input, text,
              "woven frames fit one panel, pixel for pixel: use this panel's own rig");
}

[[noreturn]] void throw_not_native(const ConnectorInfo& connector, PixelSize size) {
  std::string own;
  for (const PixelSize native : native_sizes(connector))
    own += (own.empty() ? "" : " or ") + text_of(native);
  throw Error(
      ErrorKind::Input,
      fmt::format("{}: the panel would scale {} to its own {}, which would destroy the views",
                  connector.name, text_of(size), own),
      "use this panel's own rig; if its EDID states a wrong size, load a correct EDID "
      "(drm.edid_firmware=)");
}

using Modes = std::vector<drmModeModeInfo>;

/// Returns the modes of all connectors at one rate; none if a connector has no such mode.
std::optional<Modes> modes_at(frames::Rate rate, const std::vector<ConnectorInfo>& connectors,
                              const OutputRequest& request) {
  Modes modes;
  for (size_t n = 0; n < connectors.size(); ++n) {
    const auto mode = choose_mode(connectors[n], request.panel_of(n), rate);
    if (!mode) return std::nullopt;
    modes.push_back(*mode);
  }
  return modes;
}

/// Returns a mode for each connector, all with one refresh rate: that which the first of them
/// prefers, else that of another one. Throws as require_mode() does, and Error(Input) if there is
/// no common rate.
Modes require_modes(const std::vector<ConnectorInfo>& connectors, const OutputRequest& request) {
  Modes own;
  for (size_t n = 0; n < connectors.size(); ++n)
    own.push_back(require_mode(connectors[n], request.panel_of(n), request.refresh));
  if (own.size() == 1) return own;
  for (const drmModeModeInfo& mode : own)
    if (auto common = modes_at(refresh_of(mode), connectors, request)) return *common;
  std::string text;
  for (size_t n = 0; n < connectors.size(); ++n)
    text +=
        fmt::format("{}{} runs at {}", n == 0 ? "" : ", ", connectors[n].name, to_string(own[n]));
  throw Error(
      ErrorKind::Input, text + ", and there is no rate that all panels have",
      "panels that show one picture need the same refresh rate: use panels of one model, or "
      "a player in step for each");
}

// --- CRTC and plane -------------------------------------------------------------------------

bool takes(const drmModePlane& plane, ScanoutDepth depth) {
  return std::find(plane.formats, plane.formats + plane.count_formats, drm_format(depth)) !=
         plane.formats + plane.count_formats;
}

bool is_primary(int fd, uint32_t plane) {
  const auto properties = PropertyTable::read(fd, plane, DRM_MODE_OBJECT_PLANE);
  const Property* type = properties ? properties->find("type") : nullptr;
  return type != nullptr && type->value == DRM_PLANE_TYPE_PRIMARY;
}

/// Returns the CRTC's current primary plane, else an unused primary plane; none of the pipes
/// `before`.
std::optional<uint32_t> primary_plane_for(int fd, uint32_t crtc, int crtc_index, ScanoutDepth depth,
                                          std::span<const Pipe> before) {
  const DrmPlanes planes(drmModeGetPlaneResources(fd));
  std::optional<uint32_t> free_one;
  for (uint32_t i = 0; planes && i < planes->count_planes; ++i) {
    const DrmPlane plane(drmModeGetPlane(fd, planes->planes[i]));
    if (!plane || (plane->possible_crtcs & 1U << crtc_index) == 0 || !takes(*plane, depth) ||
        !is_primary(fd, plane->plane_id) ||
        std::ranges::find(before, plane->plane_id, &Pipe::plane) != before.end())
      continue;
    if (plane->crtc_id == crtc) return plane->plane_id;
    if (plane->crtc_id == 0 && !free_one) free_one = plane->plane_id;
  }
  return free_one;
}

/// Returns the CRTCs that other connectors use.
std::vector<uint32_t> crtcs_taken(int fd, uint32_t except_connector) {
  std::vector<uint32_t> taken;
  for (const ConnectorInfo& other : read_connectors(fd, Probe::Cached))
    if (other.id != except_connector)
      taken.push_back(static_cast<uint32_t>(other.properties.value("CRTC_ID")));
  return taken;
}

/// Returns the pipe of a connector; none if no CRTC with a primary plane for the format of this
/// depth can drive the connector, apart from those of the pipes `before`.
std::optional<Pipe> choose_pipe(int fd, const ConnectorInfo& connector, const drmModeModeInfo& mode,
                                ScanoutDepth depth, std::span<const Pipe> before) {
  const DrmResources resources(drmModeGetResources(fd));
  if (!resources)
    throw Error(ErrorKind::Device,
                fmt::format("{}: the graphics card was removed", connector.name));
  const auto current = static_cast<uint32_t>(connector.properties.value("CRTC_ID"));
  const std::vector<uint32_t> taken = crtcs_taken(fd, connector.id);

  uint32_t best_crtc = 0;
  uint32_t best_plane = 0;
  int best_rank = 0;
  for (int i = 0; i < resources->count_crtcs && i < 32; ++i) {
    const uint32_t crtc = resources->crtcs[i];
    if ((connector.possible_crtcs & 1U << i) == 0) continue;
    if (std::ranges::find(before, crtc, &Pipe::crtc) != before.end()) continue;
    const bool in_use = std::find(taken.begin(), taken.end(), crtc) != taken.end();
    const int rank = crtc == current ? 3 : in_use ? 1 : 2;
    if (rank <= best_rank) continue;
    const auto plane = primary_plane_for(fd, crtc, i, depth, before);
    if (!plane) continue;
    best_crtc = crtc;
    best_plane = *plane;
    best_rank = rank;
  }
  if (best_rank == 0) return std::nullopt;
  const Tile tile = connector.tile.value_or(Tile{});
  return Pipe{.connector = connector,
              .mode = mode,
              .crtc = best_crtc,
              .plane = best_plane,
              .left_px = tile.column * tile.width,
              .top_px = tile.row * tile.height,
              .depth = depth};
}

}  // namespace

std::vector<PixelSize> native_sizes(const ConnectorInfo& connector) {
  if (connector.edid.problem != EdidProblem::None) return {};
  std::vector<PixelSize> sizes;
  for (const drmModeModeInfo& mode : connector.modes)
    if (is_preferred(mode) && std::find(sizes.begin(), sizes.end(), size_of(mode)) == sizes.end())
      sizes.push_back(size_of(mode));
  return sizes.empty() ? connector.edid.native_sizes() : sizes;
}

bool may_be_native(const ConnectorInfo& connector, PixelSize size) {
  const std::vector<PixelSize> native = native_sizes(connector);
  return native.empty() || std::find(native.begin(), native.end(), size) != native.end();
}

bool is_plain(const drmModeModeInfo& mode) {
  return (mode.flags & (DRM_MODE_FLAG_INTERLACE | DRM_MODE_FLAG_DBLSCAN)) == 0 && mode.vscan <= 1 &&
         refresh_of(mode).numerator > 0;
}

bool offers_mode(const ConnectorInfo& connector, const drmModeModeInfo& mode) {
  return may_be_native(connector, size_of(mode)) &&
         std::any_of(connector.modes.begin(), connector.modes.end(),
                     [&](const auto& listed) { return same_timings(listed, mode); });
}

PixelSize size_on(const ConnectorInfo& connector, const frames::FrameGeometry& panel) {
  const std::optional<Tile>& tile = connector.tile;
  if (tile && tile->columns * tile->width == panel.width &&
      tile->rows * tile->height == panel.height)
    return {tile->width, tile->height};
  return {panel.width, panel.height};
}

std::optional<drmModeModeInfo> choose_mode(const ConnectorInfo& connector,
                                           const frames::FrameGeometry& panel,
                                           std::optional<frames::Rate> refresh) {
  const PixelSize size = size_on(connector, panel);
  if (!may_be_native(connector, size)) return std::nullopt;
  return best_of_size(connector.modes, size, refresh);
}

drmModeModeInfo require_mode(const ConnectorInfo& connector, const frames::FrameGeometry& panel,
                             std::optional<frames::Rate> refresh) {
  if (const auto mode = choose_mode(connector, panel, refresh)) return *mode;
  const PixelSize size = size_on(connector, panel);
  if (best_of_size(connector.modes, size, std::nullopt) && !may_be_native(connector, size))
    throw_not_native(connector, size);
  throw_not_listed(connector, size, refresh);
}

std::vector<Pipe> choose_pipes(int fd, const std::vector<ConnectorInfo>& connectors,
                               const OutputRequest& request) {
  const ScanoutDepth wanted = request.depth;
  const std::vector<drmModeModeInfo> modes = require_modes(connectors, request);
  std::vector<Pipe> pipes;
  const auto choose = [&](ScanoutDepth depth) {
    pipes.clear();
    for (size_t n = 0; n < connectors.size(); ++n) {
      auto pipe = choose_pipe(fd, connectors[n], modes[n], depth, pipes);
      if (!pipe) return false;
      pipes.push_back(std::move(*pipe));
    }
    return true;
  };
  if (!choose(wanted) && (wanted == ScanoutDepth::Bits8 || !choose(ScanoutDepth::Bits8)))
    throw Error(ErrorKind::Device,
                fmt::format("{}: no CRTC with a primary plane for {}",
                            connectors[pipes.size()].name, format_name(ScanoutDepth::Bits8)),
                "disconnect another panel of this card");
  for (size_t n = 0; n < pipes.size(); ++n) {
    pipes[n].wanted = wanted;
    if (request.parts.empty()) continue;
    pipes[n].left_px = request.parts[n].place.left_px;
    pipes[n].top_px = request.parts[n].place.top_px;
  }
  return pipes;
}

}  // namespace lenticule::display
