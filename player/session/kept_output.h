// SPDX-License-Identifier: Apache-2.0
// The lit panel in the service manager's hands: a player that dies leaves its last frame on the
// glass, and the next one goes on in the same buffers.
#pragma once

#include <memory>
#include <vector>

#include "display/kms/scanout/kms_display.h"
#include "player/session/service_manager.h"

namespace lenticule::player {

/// Gives the manager the card and what a successor must know about it.
void keep_output(const ServiceManager& manager, const display::KmsDisplay& display);
void forget_output(const ServiceManager& manager);

/// What a player before us left; null if nothing, or nothing that makes sense. Other descriptors
/// are closed.
[[nodiscard]] std::shared_ptr<display::InheritedOutput> kept_output(
    std::vector<KeptDescriptor> descriptors);

}  // namespace lenticule::player
