// SPDX-License-Identifier: Apache-2.0
// Finds the one output that a request means, or the reason why there is not exactly one, and the
// pipe of each of its connectors. The order of cards and connectors never decides.
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "base/error.h"
#include "display/kms/device/connector.h"
#include "display/kms/device/drm_device.h"
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

/// Returns the panel's native sizes; the panel would scale a picture of any other size, even one
/// that it lists. These are the sizes of the modes that the kernel prefers, else the EDID's native
/// sizes (EdidReading::native_sizes()). Empty if unknown: without an EDID the preferred mode is the
/// driver's choice, as in virtual machines.
[[nodiscard]] std::vector<PixelSize> native_sizes(const ConnectorInfo& connector);
/// Returns true if the size is native or the native sizes are unknown.
[[nodiscard]] bool may_be_native(const ConnectorInfo& connector, PixelSize size);

/// Returns true if the mode is progressive without repeated lines.
[[nodiscard]] bool is_plain(const drmModeModeInfo& mode);
/// Returns true if the panel lists a mode with these timings whose size may be native.
[[nodiscard]] bool offers_mode(const ConnectorInfo& connector, const drmModeModeInfo& mode);

/// Returns the size of the mode with which a connector shows its part of a frame of `panel`: a
/// tile's size if its panel's tiles together have the size of `panel`, else the whole size.
[[nodiscard]] PixelSize size_on(const ConnectorInfo& connector, const frames::FrameGeometry& panel);

/// Returns the plain mode of exactly the size_on() a connector, if the size may be native: with
/// `refresh` the nearest one within 0.05 %, otherwise the preferred one, otherwise the fastest.
[[nodiscard]] std::optional<drmModeModeInfo> choose_mode(const ConnectorInfo& connector,
                                                         const frames::FrameGeometry& panel,
                                                         std::optional<frames::Rate> refresh);

/// Returns the same mode. Throws Error(Input) that lists the panel's modes if there is none; never
/// chooses a smaller mode.
[[nodiscard]] drmModeModeInfo require_mode(const ConnectorInfo& connector,
                                           const frames::FrameGeometry& panel,
                                           std::optional<frames::Rate> refresh);

/// Chooses the pipes of an output's connectors: one, the tiles of a panel, or the panels of a wall.
/// Prefers the CRTC that already drives a connector (its mode can then be taken over without a
/// modeset), then an unused one. All modes have one refresh rate. The pipes have the request's
/// depth, or all have Bits8 if a primary plane lacks its format. Throws as require_mode() does,
/// Error(Input) if there is no common rate, and Error(Device) if there is no pipe for a connector.
[[nodiscard]] std::vector<Pipe> choose_pipes(int fd, const std::vector<ConnectorInfo>& connectors,
                                             const OutputRequest& request);

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

/// Opens all cards and probes every connector, which may take hundreds of milliseconds each. If
/// `previous`, the descriptor of the previous player, is one of the cards, it is used, because it
/// is DRM master already, and `previous` is reset.
[[nodiscard]] ConnectorList list_connectors(const std::shared_ptr<Session>& session,
                                            std::optional<DrmDevice>& previous,
                                            const OpenCard& open = {});

struct OutputChoice {
  std::optional<size_t> chosen{};  ///< index in ConnectorList::connectors
  /// All connectors of the chosen panel, in rows from its top left, or of a wall's panels in the
  /// order of the request; `chosen` is the first.
  std::vector<size_t> tiles{};
  /// If none was chosen: the error, and whether waiting for a panel may help.
  Error refusal{ErrorKind::Device, ""};
  bool may_come = false;
  /// Connectors with a panel of any identity on the requested output.
  std::vector<size_t> present{};
};

[[nodiscard]] OutputChoice choose_output(const OutputRequest& request, const ConnectorList& list);

}  // namespace lenticule::display
