// SPDX-License-Identifier: Apache-2.0
// Inspects every card and panel without displaying anything, for `panels` and `doctor`.
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "display/kms/color/exactness_report.h"
#include "display/kms/device/edid.h"
#include "display/kms/device/platform.h"
#include "display/kms/device/session.h"
#include "display/kms/probe/output_key.h"
#include "frames/rational.h"

namespace lenticule::display {

struct ModeFacts {
  int width = 0;
  int height = 0;
  frames::Rate refresh;
  bool preferred = false;
  bool native = false;  ///< the panel's own size, as far as known
  bool usable = false;  ///< progressive without repeated lines
};

struct PanelFacts {
  std::string card;       ///< path of the card's node
  std::string connector;  ///< "HDMI-A-1"
  bool connected = false;
  bool non_desktop = false;
  bool tiled = false;
  bool link_bad = false;
  uint32_t width_mm = 0;
  uint32_t height_mm = 0;
  EdidProblem edid_problem = EdidProblem::Absent;
  std::optional<EdidIdentity> identity;
  std::vector<ModeFacts> modes;
};

struct CardFacts {
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
  std::vector<CardFacts> cards;
  std::vector<PanelFacts> panels;
};

/// Collects all available facts; a card that cannot be opened is listed with its problem. DRM
/// master acquired by opening a card is dropped at once.
[[nodiscard]] Inspection inspect_cards(const std::shared_ptr<Session>& session);

/// The effect of playing on this panel on its output.
struct Diagnosis {
  PanelFacts panel;
  std::string driver{};
  std::string problem{};  ///< reason why nothing could be displayed; empty if frames can be
  std::string remedy{};
  /// True if the driver tested the settings; not possible while another process is DRM master.
  bool tested = false;
  ExactnessReport exactness{};  ///< outcomes are "would be forced"
};

/// Diagnoses every connected panel that the key names. Commits nothing.
[[nodiscard]] std::vector<Diagnosis> diagnose(
    const std::shared_ptr<Session>& session, const OutputKey& key,
    const std::shared_ptr<KmsPlatform>& platform = make_linux_platform());

}  // namespace lenticule::display
