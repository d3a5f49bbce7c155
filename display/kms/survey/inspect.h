// SPDX-License-Identifier: Apache-2.0
// Looks at every card and panel without showing anything: what `panels` and `doctor` print.
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
  bool native = false;  ///< of the panel's own size, as far as anybody knows
  bool usable = false;  ///< progressive, each line once
};

struct PanelFacts {
  std::string card;       ///< path of its node
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
  std::string problem{};  ///< why it cannot be used; empty if it can
  bool master = false;    ///< could be ours at this moment
  bool prefers_shadow = false;
  /// The driver counts vblanks; none if no output runs, so that it could not be asked.
  std::optional<bool> counts_vblanks{};
};

struct Inspection {
  std::vector<CardFacts> cards;
  std::vector<PanelFacts> panels;
};

/// Whatever can be found out; a card that cannot be opened is listed with its problem. Mastership
/// that opening brings is given back at once.
[[nodiscard]] Inspection inspect_cards(const std::shared_ptr<Session>& session);

/// What playing on this panel would do to its output.
struct Diagnosis {
  PanelFacts panel;
  std::string driver{};
  std::string problem{};  ///< why nothing could be shown there; empty if it could
  std::string remedy{};
  /// The driver was asked whether it takes the settings; not possible while another is master.
  bool tested = false;
  ExactnessReport exactness{};  ///< with outcomes "would be forced"
};

/// Of every connected panel that the key names. Commits nothing.
[[nodiscard]] std::vector<Diagnosis> diagnose(
    const std::shared_ptr<Session>& session, const OutputKey& key,
    const std::shared_ptr<KmsPlatform>& platform = make_linux_platform());

}  // namespace lenticule::display
