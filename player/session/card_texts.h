// SPDX-License-Identifier: Apache-2.0
// The texts of the test cards.
#pragma once

#include <string>

#include "display/kms/inspect.h"
#include "display/test_card.h"
#include "optics/rig.h"

namespace lenticule::player {

/// Describes the panel that a rig names: "3840x2160 pixels, LGD 0x1234 serial 42".
[[nodiscard]] std::string describe_expected(const frames::FrameGeometry& panel,
                                            const optics::PanelIdentity& identity);
/// Describes a connected panel: "HDMI-A-1: LGD 0x1234 serial 42 'name', 3840x2160@60".
[[nodiscard]] std::string describe_found(const display::PanelInfo& panel);

/// Returns the card that is shown on `shown_on`, one of the panels that are connected instead of
/// the requested one. `rig` is the name of the rig's file.
[[nodiscard]] display::CardText wrong_panel_card(const display::OutputRequest& request,
                                                 const display::PanelSearch& search,
                                                 const display::PanelInfo& shown_on,
                                                 const std::string& rig);

/// Returns the card that is shown while `what` cannot be played and is tried again.
[[nodiscard]] display::CardText error_card(const std::string& what, const Error& error);

/// Returns the card of `lenticule play card`.
[[nodiscard]] display::CardText rig_card(const optics::Rig& rig, const std::string& file);

}  // namespace lenticule::player
