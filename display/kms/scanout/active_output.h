// SPDX-License-Identifier: Apache-2.0
// ActiveOutput is an output that shows frames, with its scan-out buffers. It is opened by taking
// over the buffers or the mode of the previous user of the card, or by a modeset.
#pragma once

#include <memory>

#include "display/kms/scanout/kms_display.h"
#include "display/kms/scanout/kms_output.h"
#include "display/kms/scanout/scanout_pool.h"
#include "display/kms/scanout/takeover_state.h"

namespace lenticule::display {

struct ActiveOutput {
  std::unique_ptr<KmsOutput> output;
  ScanoutPool buffers;         ///< released before the output
  KmsBuffer* front = nullptr;  ///< the displayed buffer
};

/// Opens the requested output. All services in `options` must be set. Takes over
/// `options.previous`; if any part of its state does not match, frees its buffers and finds
/// connector, mode and CRTC itself. Throws as open_kms_display().
[[nodiscard]] ActiveOutput open_output(const KmsOptions& options);

/// Throws Error(Quality) if the output is known to change subpixels and that is not allowed.
void require_exact(const KmsOptions& options, const KmsOutput& output);

/// Describes the output for the next player.
[[nodiscard]] TakeoverState takeover_state_of(const ActiveOutput& active,
                                              frames::FrameGeometry geometry);

}  // namespace lenticule::display
