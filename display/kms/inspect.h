// SPDX-License-Identifier: Apache-2.0
// Describes cards and panels without displaying anything: all of them for `panels`, the requested
// one for a player that waits for it, and the effect of playing on it for `doctor`. These structs
// have no types of libdrm.
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "base/error.h"
#include "display/kms/color/exactness_report.h"
#include "display/kms/device/edid.h"
#include "display/kms/device/platform.h"
#include "display/kms/probe/output_request.h"
#include "display/kms/scanout/kms_display.h"
#include "frames/rational.h"

namespace lenticule::display {

struct ModeInfo {
  int width = 0;
  int height = 0;
  frames::Rate refresh;
  bool preferred = false;
  bool native = false;  ///< the panel's own size, as far as known
  bool usable = false;  ///< progressive without repeated lines
};

struct PanelInfo : ConnectorFacts {
  std::string card;       ///< path of the card's node
  std::string connector;  ///< "HDMI-A-1"
  EdidProblem edid_problem = EdidProblem::Absent;
  std::optional<EdidIdentity> identity;
  std::vector<ModeInfo> modes;
};

struct CardInfo {
  std::string path;
  std::string bus{};
  std::string driver{};
  std::string problem{};  ///< reason why it cannot be used; empty if it can
  bool master = false;    ///< this process could become DRM master now
  bool prefers_shadow = false;
  /// True if the driver counts vblanks; none if no output is active, because only an active one can
  /// be queried.
  std::optional<bool> counts_vblanks{};
};

struct Inspection {
  std::vector<CardInfo> cards;
  std::vector<PanelInfo> panels;
};

/// Collects all available data; a card that cannot be opened is listed with its problem. DRM
/// master acquired by opening a card is dropped at once.
[[nodiscard]] Inspection inspect_cards(const std::shared_ptr<Session>& session);

struct PanelSearch {
  /// Exactly one panel matches and has the mode: open_kms_display() would open it.
  bool found = false;
  /// If not found: the error that open_kms_display() would throw. May list every connector.
  Error refusal{ErrorKind::Device, ""};
  /// True if a panel that is connected later could match.
  bool may_come = true;
  /// Panels at the requested connector, also those of another identity; all connected panels if
  /// the request names no connector.
  std::vector<PanelInfo> present{};
};

/// Finds the requested panel, or the reason why none matches. Probes every connector of every card,
/// with the request and the session (which must be set) of `options`. `active` is an open display
/// of this process, whose card is probed through it; null if there is none. Throws only if memory
/// is exhausted.
[[nodiscard]] PanelSearch search_panel(const KmsOptions& options,
                                       const KmsDisplay* active = nullptr);

/// The effect of playing on this panel on its output.
struct Diagnosis {
  PanelInfo panel;                        ///< panel, as its first connector describes it
  std::vector<std::string> connectors{};  ///< names of the panel's connectors, the first one first
  std::string driver{};
  std::string problem{};  ///< reason why nothing could be displayed; empty if frames can be
  std::string remedy{};
  /// True if the driver tested the settings; not possible while another process is DRM master.
  bool tested = false;
  ExactnessReport exactness{};  ///< outcomes are "would be forced"
};

/// Diagnoses every connected panel on the requested output, of any identity and size. A panel of
/// several tiles is tested as one, or has the problem that a tile is missing. Commits nothing.
[[nodiscard]] std::vector<Diagnosis> diagnose(
    const std::shared_ptr<Session>& session, const OutputRequest& request,
    const std::shared_ptr<KmsPlatform>& platform = make_linux_platform());

/// PlacedTile is one place of a tiled panel.
struct PlacedTile {
  int column = 0;
  int row = 0;
  std::string connector{};  ///< connector with a panel there; empty if no cable leads there
};

/// TileGroup is a panel of several tiles, as the connected ones describe it.
struct TileGroup {
  std::string card;    ///< path of the card's node
  uint32_t group = 0;  ///< the kernel's number
  int columns = 1, rows = 1;
  int width = 0, height = 0;        ///< pixels of the whole panel
  std::vector<PlacedTile> tiles{};  ///< every place, in rows from the top left

  /// Returns true if every tile is connected.
  [[nodiscard]] bool complete() const;
};

/// Returns the groups of the panels, in the order of their first connectors. Disconnected
/// connectors and those whose tile is not known are left out.
[[nodiscard]] std::vector<TileGroup> tile_groups(const std::vector<PanelInfo>& panels);

}  // namespace lenticule::display
