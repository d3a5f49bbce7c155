// SPDX-License-Identifier: Apache-2.0
// What the test cards say.
#pragma once

#include <string>

#include "display/kms/survey/panel_search.h"
#include "display/test_card.h"
#include "optics/rig.h"

namespace lenticule::player {

/// "3840x2160 pixels, LGD 0x1234 serial 42" of the panel that a rig names.
[[nodiscard]] std::string describe_expected(const frames::FrameGeometry& panel,
                                            const optics::PanelIdentity& identity);
/// "HDMI-A-1: LGD 0x1234 serial 42 'name', 3840x2160@60"
[[nodiscard]] std::string describe_found(const display::PanelFacts& panel);

/// For `shown_on`, one of the panels that are there instead of the one that is wanted. `rig` is the
/// name of its file.
[[nodiscard]] display::CardText wrong_panel_card(const display::OutputWish& wish,
                                                 const display::PanelSearch& search,
                                                 const display::PanelFacts& shown_on,
                                                 const std::string& rig);

/// What cannot be played, and is tried again.
[[nodiscard]] display::CardText trouble_card(const std::string& what, const Error& error);

/// `lenticule play card`.
[[nodiscard]] display::CardText rig_card(const optics::Rig& rig, const std::string& file);

}  // namespace lenticule::player
