// SPDX-License-Identifier: Apache-2.0
// Finds the one output that a request means, or the reason why there is not exactly one, and the
// pipe of each of its connectors. The order of cards and connectors never decides.
#pragma once

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "base/error_kinds.h"
#include "display/kms/device/connector.h"
#include "display/kms/device/drm_device.h"
#include "display/kms/device/drm_properties.h"
#include "display/kms/device/edid.h"
#include "display/kms/device/platform.h"
#include "display/kms/probe/output_request.h"
#include "display/scanout_depth.h"
#include "frames/frame.h"

namespace lenticule::display {

/// Pipe is the connector, the mode, the CRTC and the primary plane with which a panel, or a tile of
/// a panel, shows frames pixel for pixel. These functions choose them.
struct Pipe {
  ConnectorInfo connector;
  drmModeModeInfo mode{};
  uint32_t crtc = 0;
  int crtc_number = 0;  ///< place of the CRTC in the card's list
  uint32_t plane = 0;
  /// Position in the frame of a tile, or of a wall's panel; 0 for a panel with one connector.
  int left_px = 0;
  int top_px = 0;
  ScanoutDepth depth = ScanoutDepth::Bits8;   ///< depth of the frames that are scanned out
  ScanoutDepth wanted = ScanoutDepth::Bits8;  ///< depth that the rig states

  /// Return the values of SRC_X and SRC_Y, in 1/65536 pixel.
  [[nodiscard]] uint64_t source_x() const { return static_cast<uint64_t>(left_px) << 16; }
  [[nodiscard]] uint64_t source_y() const { return static_cast<uint64_t>(top_px) << 16; }
};

struct CardConnector {
  std::string card;  ///< path of the card's node
  ConnectorInfo info;
  /// Index in ConnectorList::devices; none if the list did not open the card.
  std::optional<size_t> device{};
};

struct ConnectorList {
  std::vector<DrmDevice> devices{};
  std::vector<CardConnector> connectors{};
  std::optional<Error> problem{};  ///< error of a card that could not be opened
};

/// A card that this process has already open: only its DRM master can probe connectors again.
struct OpenCard {
  int fd = -1;  ///< borrowed
  std::string path{};
};

struct OutputChoice {
  /// Indices, in ConnectorList::connectors, of all connectors of the chosen panel, in rows from its
  /// top left, or of a wall's panels in the order of the request. Empty if none was chosen.
  std::vector<size_t> tiles{};
  /// If none was chosen: the error, and whether waiting for a panel may help.
  Error refusal{ErrorKind::Device, ""};
  bool may_come = false;
  /// Connectors with a panel of any identity on the requested output.
  std::vector<size_t> present{};

  [[nodiscard]] std::vector<ConnectorInfo> connectors_in(const ConnectorList& list) const {
    std::vector<ConnectorInfo> chosen;
    for (const size_t tile : tiles) chosen.push_back(list.connectors[tile].info);
    return chosen;
  }
};

// --- mode -----------------------------------------------------------------------------------

// A request for 60 matches 59.997 and does not match 59.94.
inline constexpr double kRefreshTolerance = 0.0005;

inline PixelSize size_of(const drmModeModeInfo& mode) { return {mode.hdisplay, mode.vdisplay}; }

inline double relative_error(const drmModeModeInfo& mode, frames::Rate refresh) {
  return std::abs(refresh_of(mode).hertz() / refresh.hertz() - 1.0);
}

/// Returns true if `a` is the better choice. If both are equally good, the one with the lower pixel
/// clock is better: it needs less link bandwidth, and is rarely a television timing with a limited
/// range of values.
inline bool better(const drmModeModeInfo& a, const drmModeModeInfo& b,
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

/// Returns the panel's native sizes; the panel would scale a picture of any other size, even one
/// that it lists. These are the sizes of the modes that the kernel prefers, else the EDID's native
/// sizes (EdidReading::native_sizes()). Empty if unknown: without an EDID the preferred mode is the
/// driver's choice, as in virtual machines.
[[nodiscard]] inline std::vector<PixelSize> native_sizes(const ConnectorInfo& connector) {
  if (connector.edid.problem != EdidProblem::None) return {};
  std::vector<PixelSize> sizes;
  for (const drmModeModeInfo& mode : connector.modes)
    if (is_preferred(mode) && std::find(sizes.begin(), sizes.end(), size_of(mode)) == sizes.end())
      sizes.push_back(size_of(mode));
  return sizes.empty() ? connector.edid.native_sizes() : sizes;
}

/// Returns true if the mode is progressive without repeated lines.
[[nodiscard]] inline bool is_plain(const drmModeModeInfo& mode) {
  return (mode.flags & (DRM_MODE_FLAG_INTERLACE | DRM_MODE_FLAG_DBLSCAN)) == 0 && mode.vscan <= 1 &&
         refresh_of(mode).numerator > 0;
}

inline std::optional<drmModeModeInfo> best_of_size(const std::vector<drmModeModeInfo>& modes,
                                                   PixelSize size,
                                                   std::optional<frames::Rate> refresh) {
  std::optional<drmModeModeInfo> best;
  for (const drmModeModeInfo& mode : modes) {
    if (size_of(mode) != size || !is_plain(mode)) continue;
    if (refresh && relative_error(mode, *refresh) > kRefreshTolerance) continue;
    if (!best || better(mode, *best, refresh)) best = mode;
  }
  return best;
}

inline std::string text_of(PixelSize size) { return fmt::format("{}x{}", size.width, size.height); }

[[noreturn]] inline void throw_not_listed(const ConnectorInfo& connector, PixelSize size,
                                          std::optional<frames::Rate> refresh) {
  std::string wanted = text_of(size);
  if (refresh) wanted += fmt::format("@{}", frames::to_string(*refresh));
  std::string text = fmt::format("{}: no progressive mode {}; it has", connector.name, wanted);
  for (const drmModeModeInfo& mode : connector.modes) text += fmt::format(" {}", to_string(mode));
  if (connector.modes.empty()) text += " none";
  throw Error(ErrorKind::Input, text,
              "woven frames fit one panel, pixel for pixel: use this panel's own rig");
}

[[noreturn]] inline void throw_not_native(const ConnectorInfo& connector, PixelSize size) {
  std::string own;
  for (const PixelSize native : native_sizes(connector))
    own += (own.empty() ? "" : " or ") + text_of(native);
  throw input_error("{}: the panel would scale {} to its own {}, which would destroy the views",
                    connector.name, text_of(size), own)
      .remedy(
          "use this panel's own rig; if its EDID states a wrong size, load a correct EDID "
          "(drm.edid_firmware=)");
}

/// Returns true if the size is native or the native sizes are unknown.
[[nodiscard]] inline bool may_be_native(const ConnectorInfo& connector, PixelSize size) {
  const std::vector<PixelSize> native = native_sizes(connector);
  return native.empty() || std::find(native.begin(), native.end(), size) != native.end();
}

/// Returns true if the panel lists a mode with these timings whose size may be native.
[[nodiscard]] inline bool offers_mode(const ConnectorInfo& connector, const drmModeModeInfo& mode) {
  return may_be_native(connector, size_of(mode)) &&
         std::any_of(connector.modes.begin(), connector.modes.end(),
                     [&](const auto& listed) { return same_timings(listed, mode); });
}

/// Returns the size of the mode with which a connector shows its part of a frame of `panel`: a
/// tile's size if its panel's tiles together have the size of `panel`, else the whole size.
[[nodiscard]] inline PixelSize size_on(const ConnectorInfo& connector,
                                       const frames::FrameGeometry& panel) {
  const std::optional<Tile>& tile = connector.tile;
  if (tile && tile->columns * tile->width == panel.width &&
      tile->rows * tile->height == panel.height)
    return {tile->width, tile->height};
  return {panel.width, panel.height};
}

/// Returns the plain mode of exactly the size_on() a connector, if the size may be native: with
/// `refresh` the nearest one within 0.05 %, otherwise the preferred one, otherwise the fastest.
[[nodiscard]] inline std::optional<drmModeModeInfo> choose_mode(
    const ConnectorInfo& connector, const frames::FrameGeometry& panel,
    std::optional<frames::Rate> refresh) {
  const PixelSize size = size_on(connector, panel);
  if (!may_be_native(connector, size)) return std::nullopt;
  return best_of_size(connector.modes, size, refresh);
}

/// Returns the same mode. Throws Error(Input) that lists the panel's modes if there is none; never
/// chooses a smaller mode.
[[nodiscard]] inline drmModeModeInfo require_mode(const ConnectorInfo& connector,
                                                  const frames::FrameGeometry& panel,
                                                  std::optional<frames::Rate> refresh) {
  if (const auto mode = choose_mode(connector, panel, refresh)) return *mode;
  const PixelSize size = size_on(connector, panel);
  if (best_of_size(connector.modes, size, std::nullopt) && !may_be_native(connector, size))
    throw_not_native(connector, size);
  throw_not_listed(connector, size, refresh);
}

using Modes = std::vector<drmModeModeInfo>;

/// Returns the modes of all connectors at one rate; none if a connector has no such mode.
inline std::optional<Modes> modes_at(frames::Rate rate,
                                     const std::vector<ConnectorInfo>& connectors,
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
inline Modes require_modes(const std::vector<ConnectorInfo>& connectors,
                           const OutputRequest& request) {
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

inline bool takes(const drmModePlane& plane, ScanoutDepth depth) {
  return std::find(plane.formats, plane.formats + plane.count_formats, drm_format(depth)) !=
         plane.formats + plane.count_formats;
}

inline bool is_primary(int fd, uint32_t plane) {
  const auto properties = PropertyTable::read(fd, plane, DRM_MODE_OBJECT_PLANE);
  const Property* type = properties ? properties->find("type") : nullptr;
  return type != nullptr && type->value == DRM_PLANE_TYPE_PRIMARY;
}

/// Returns the CRTC's current primary plane, else an unused primary plane; none of the pipes
/// `before`.
inline std::optional<uint32_t> primary_plane_for(int fd, uint32_t crtc, int crtc_index,
                                                 ScanoutDepth depth, std::span<const Pipe> before) {
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
inline std::vector<uint32_t> crtcs_taken(int fd, uint32_t except_connector) {
  std::vector<uint32_t> taken;
  for (const ConnectorInfo& other : read_connectors(fd, Probe::Cached))
    if (other.id != except_connector)
      taken.push_back(static_cast<uint32_t>(other.properties.value("CRTC_ID")));
  return taken;
}

/// Returns the pipe of a connector; none if no CRTC with a primary plane for the format of this
/// depth can drive the connector, apart from those of the pipes `before`.
inline std::optional<Pipe> choose_pipe(int fd, const ConnectorInfo& connector,
                                       const drmModeModeInfo& mode, ScanoutDepth depth,
                                       std::span<const Pipe> before) {
  const DrmResources resources(drmModeGetResources(fd));
  if (!resources) throw device_error("{}: the graphics card was removed", connector.name);
  const auto current = static_cast<uint32_t>(connector.properties.value("CRTC_ID"));
  const std::vector<uint32_t> taken = crtcs_taken(fd, connector.id);

  int best_crtc = 0;
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
    best_crtc = i;
    best_plane = *plane;
    best_rank = rank;
  }
  if (best_rank == 0) return std::nullopt;
  const Tile tile = connector.tile.value_or(Tile{});
  return Pipe{.connector = connector,
              .mode = mode,
              .crtc = resources->crtcs[best_crtc],
              .crtc_number = best_crtc,
              .plane = best_plane,
              .left_px = tile.column * tile.width,
              .top_px = tile.row * tile.height,
              .depth = depth};
}

/// Chooses the pipes of an output's connectors: one, the tiles of a panel, or the panels of a wall.
/// Prefers the CRTC that already drives a connector (its mode can then be taken over without a
/// modeset), then an unused one. All modes have one refresh rate. The pipes have the request's
/// depth, or all have Bits8 if a primary plane lacks its format. Throws as require_mode() does,
/// Error(Input) if there is no common rate, and Error(Device) if there is no pipe for a connector.
[[nodiscard]] inline std::vector<Pipe> choose_pipes(int fd,
                                                    const std::vector<ConnectorInfo>& connectors,
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
    throw device_error("{}: no CRTC with a primary plane for {}", connectors[pipes.size()].name,
                       format_name(ScanoutDepth::Bits8))
        .remedy("disconnect another panel of this card");
  for (size_t n = 0; n < pipes.size(); ++n) {
    pipes[n].wanted = wanted;
    if (request.parts.empty()) continue;
    pipes[n].left_px = request.parts[n].place.left_px;
    pipes[n].top_px = request.parts[n].place.top_px;
  }
  return pipes;
}

// --- listing --------------------------------------------------------------------------------

inline void add_connectors(ConnectorList& list, int fd, const std::string& card,
                           std::optional<size_t> device) {
  for (ConnectorInfo& info : read_connectors(fd, Probe::Full))
    list.connectors.push_back({card, std::move(info), device});
}

inline void add_device(ConnectorList& list, DrmDevice device) {
  add_connectors(list, device.fd(), device.path(), list.devices.size());
  list.devices.push_back(std::move(device));
}

// --- choosing -------------------------------------------------------------------------------

using Indices = std::vector<size_t>;

inline constexpr const char* kNameItsOutput =
    "name the connector of each panel in the wall's file: output = \"DP-1\"";

inline bool is_named(const CardConnector& candidate, const OutputRequest& request) {
  const ConnectorInfo& info = candidate.info;
  if (!request.connector.empty() && info.name != request.connector) return false;
  if (!request.card.empty() && !same_device(candidate.card, request.card)) return false;
  return request.edid.empty() || (info.edid.identity && matches(request.edid, *info.edid.identity));
}

/// Returns true if the request names one output, not a card with several ones.
inline bool names_one_output(const OutputRequest& request) {
  return !request.connector.empty() || !request.edid.empty();
}

/// Keeps the candidates that pass, unless none does.
inline void narrow(Indices& indices, const std::function<bool(size_t)>& passes) {
  Indices kept;
  std::copy_if(indices.begin(), indices.end(), std::back_inserter(kept), passes);
  if (!kept.empty()) indices = kept;
}

class Chooser {
 public:
  Chooser(const OutputRequest& request, const ConnectorList& list)
      : request_(request), list_(list) {}

  [[nodiscard]] OutputChoice choose() const {
    if (!request_.parts.empty()) return choose_parts();
    Indices indices = named();
    if (indices.empty())
      return refuse(
          ErrorKind::Device, "no such output",
          list_.connectors.empty() ? "--display virtual works without one" : "use one of those",
          true);
    std::erase_if(indices, [&](size_t i) { return !at(i).connected; });
    if (indices.empty())
      return refuse(ErrorKind::Device, "no panel is connected",
                    "switch the panel on and check its cable", true);
    if (checks_identity()) return choose_by_identity(indices);
    if (!names_one_output(request_))
      narrow(indices, [&](size_t i) {
        return choose_mode(at(i), request_.panel, std::nullopt).has_value();
      });
    return only_one(indices);
  }

  /// Returns the connected candidates on the requested output. A request by EDID does not restrict
  /// the output.
  [[nodiscard]] Indices present() const {
    Indices indices;
    for (size_t i = 0; i < list_.connectors.size(); ++i) {
      const bool here = !request_.edid.empty() || is_named(list_.connectors[i], request_);
      const bool usable = !at(i).non_desktop || !request_.connector.empty();
      if (here && usable && at(i).connected) indices.push_back(i);
    }
    return indices;
  }

 private:
  [[nodiscard]] const ConnectorInfo& at(size_t i) const { return list_.connectors[i].info; }
  [[nodiscard]] bool checks_identity() const {
    return request_.policy == IdentityPolicy::Require && !request_.identity.empty();
  }

  [[nodiscard]] Indices named() const {
    Indices indices;
    for (size_t i = 0; i < list_.connectors.size(); ++i)
      if (is_named(list_.connectors[i], request_) &&
          (!at(i).non_desktop || names_one_output(request_)))
        indices.push_back(i);
    return indices;
  }

  [[nodiscard]] OutputChoice choose_by_identity(Indices indices) const {
    std::erase_if(indices, [&](size_t i) {
      return !at(i).edid.identity || !matches(request_.identity, *at(i).edid.identity);
    });
    if (!indices.empty()) return only_one(indices);
    return refuse(ErrorKind::Input,
                  fmt::format("none is the panel that the rig was made for ({})",
                              to_string(request_.identity)),
                  "connect that panel, or use this panel's own rig", true);
  }

  /// Chooses a connector for each panel of a wall.
  [[nodiscard]] OutputChoice choose_parts() const {
    OutputChoice wall;
    for (const OutputPart& part : request_.parts) {
      OutputChoice one = Chooser(request_for(part), list_).choose();
      if (one.tiles.empty()) {
        const bool ambiguous = part.connector.empty() && !one.may_come;
        return refuse_part(part, one.refusal.kind(), one.refusal.what(),
                           ambiguous ? kNameItsOutput : one.refusal.hint(), one.may_come);
      }
      const size_t chosen = one.tiles.front();
      if (at(chosen).tiled)
        return refuse_part(part, ErrorKind::Device, "kms: a panel with several connectors",
                           "play it with a player of its own", false);
      if (std::ranges::find(wall.tiles, chosen) != wall.tiles.end())
        return refuse_part(part, ErrorKind::Device,
                           fmt::format("kms: {} is another panel of the wall", at(chosen).name),
                           kNameItsOutput, false);
      wall.tiles.push_back(chosen);
      if (list_.connectors[chosen].card != list_.connectors[wall.tiles.front()].card)
        return refuse_part(part, ErrorKind::Device, "kms: is on another graphics card",
                           "connect all panels to one card, or use a player in step for each card",
                           true);
    }
    return wall;
  }

  [[nodiscard]] OutputRequest request_for(const OutputPart& part) const {
    OutputRequest one = request_;
    one.parts.clear();
    one.connector = part.connector;
    one.identity = part.identity;
    one.panel = part.place.geometry;
    return one;
  }

  [[nodiscard]] static OutputChoice refuse_part(const OutputPart& part, ErrorKind kind,
                                                const std::string& cause, const std::string& remedy,
                                                bool may_come) {
    return {.refusal = {kind, fmt::format("panel '{}': {}", part.name, cause), remedy},
            .may_come = may_come};
  }

  [[nodiscard]] OutputChoice only_one(const Indices& indices) const {
    const Indices tiles = tiles_of(indices.front());
    const auto is_tile = [&](size_t i) { return std::ranges::find(tiles, i) != tiles.end(); };
    if (!std::ranges::all_of(indices, is_tile))
      return refuse(ErrorKind::Device, "more than one panel fits",
                    "choose one: --display kms:CONNECTOR", false);
    const ConnectorInfo& first = at(indices.front());
    if (!first.tiled) return {.tiles = tiles};
    if (!first.tile)
      return refuse(ErrorKind::Device, "the panel's tiles are not known",
                    "set the panel to single-stream transport in its menu", false);
    if (tiles.size() != static_cast<size_t>(first.tile->count()))
      return refuse(ErrorKind::Device,
                    fmt::format("the panel has {} connectors, and {} of them can be used",
                                first.tile->count(), tiles.size()),
                    "connect all of its cables to one graphics card", true);
    return {.tiles = tiles};
  }

  /// Returns the connected tiles of the panel at connector `i`, on the same card, in rows from the
  /// top left, each place once. A panel without tiles has one.
  [[nodiscard]] Indices tiles_of(size_t i) const {
    if (!at(i).tile) return {i};
    const Tile& tile = *at(i).tile;
    Indices tiles;
    for (int place = 0; place < tile.count(); ++place) {
      Tile wanted = tile;
      wanted.column = place % tile.columns;
      wanted.row = place / tile.columns;
      for (size_t n = 0; n < list_.connectors.size(); ++n)
        if (list_.connectors[n].card == list_.connectors[i].card && at(n).connected &&
            at(n).tile == wanted) {
          tiles.push_back(n);
          break;
        }
    }
    return tiles;
  }

  [[nodiscard]] OutputChoice refuse(ErrorKind kind, const std::string& cause,
                                    const std::string& remedy, bool may_come) const {
    if (list_.problem && list_.connectors.empty())
      return {.refusal = *list_.problem, .may_come = may_come};
    std::string text = "kms: " + cause;
    const char* separator = ": ";
    for (const CardConnector& candidate : list_.connectors)
      text += std::exchange(separator, "; ") + describe(candidate.info, candidate.card);
    if (list_.connectors.empty()) text += " (no graphics card has an output)";
    if (list_.problem) text += fmt::format(" ({})", list_.problem->what());
    return {.refusal = {kind, text, remedy}, .may_come = may_come};
  }

  const OutputRequest& request_;
  const ConnectorList& list_;
};

/// Opens all cards and probes every connector, which may take hundreds of milliseconds each. If
/// `previous`, the descriptor of the previous player, is one of the cards, it is used, because it
/// is DRM master already, and `previous` is reset.
[[nodiscard]] inline ConnectorList list_connectors(const std::shared_ptr<Session>& session,
                                                   std::optional<DrmDevice>& previous,
                                                   const OpenCard& open = {}) {
  ConnectorList list;
  for (const DrmNode& node : find_drm_nodes()) {
    try {
      if (open.fd >= 0 && same_device(open.path, node.path))
        add_connectors(list, open.fd, open.path, std::nullopt);
      else if (previous && previous->fd() >= 0 && same_device(previous->path(), node.path))
        add_device(list, std::move(*previous));
      else
        add_device(list, DrmDevice::open(session, node));
    } catch (const Error& error) {
      list.problem = error;
    }
  }
  return list;
}

[[nodiscard]] inline OutputChoice choose_output(const OutputRequest& request,
                                                const ConnectorList& list) {
  const Chooser chooser(request, list);
  OutputChoice choice = chooser.choose();
  choice.present = chooser.present();
  return choice;
}

}  // namespace lenticule::display
