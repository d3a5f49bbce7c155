// SPDX-License-Identifier: Apache-2.0
// Handles a safe start whose rig cannot be read: the panel's size is unknown, and the error is
// shown on the panel that is connected.
#pragma once

#include <optional>

#include "player/session/play_plan.h"
#include "player/session/service_manager.h"

namespace lenticule::player {

/// Makes the plan as make_plan() does. If the display is a panel, a missing or broken rig does not
/// throw: its test card stays on the connected panel until the rig can be read. None when
/// interrupted. `services` supplies the clock, session and platform; the real ones are used where
/// they are null.
[[nodiscard]] std::optional<PlayPlan> plan_when_rig_is_right(
    const PlayFlags& flags, const ServiceManager& manager,
    const display::KmsOptions& services = {});

}  // namespace lenticule::player
