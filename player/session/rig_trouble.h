// SPDX-License-Identifier: Apache-2.0
// A careful start whose rig cannot be read: nobody knows the panel's size, but there is a panel to
// say so on.
#pragma once

#include <optional>

#include "player/session/play_plan.h"
#include "player/session/service_manager.h"

namespace lenticule::player {

/// As make_plan(). Where a panel would be played on, a rig that is missing or broken is no Error:
/// its test card stays on the panel that is there until the rig can be read. None when interrupted.
/// `services` are the clock, session and platform for that, the real ones where they are null.
[[nodiscard]] std::optional<PlayPlan> plan_when_rig_is_right(
    const PlayFlags& flags, const ServiceManager& manager,
    const display::KmsOptions& services = {});

}  // namespace lenticule::player
