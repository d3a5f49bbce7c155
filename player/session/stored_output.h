// SPDX-License-Identifier: Apache-2.0
// store_output stores the active output in the service manager's fd store: the last frame of a
// player that dies stays displayed, and the next player continues in the same buffers.
#pragma once

#include <memory>
#include <vector>

#include "display/kms/scanout/kms_display.h"
#include "player/session/service_manager.h"

namespace lenticule::player {

/// Stores a descriptor of the card and the state that a successor needs.
void store_output(const ServiceManager& manager, const display::KmsDisplay& display);
void forget_output(const ServiceManager& manager);

/// Returns the output that a previous player left; null if there is none or its state is not valid.
/// Closes the other descriptors.
[[nodiscard]] std::shared_ptr<display::PreviousOutput> stored_output(
    std::vector<StoredDescriptor> descriptors);

}  // namespace lenticule::player
