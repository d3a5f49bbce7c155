// SPDX-License-Identifier: Apache-2.0
// open_display opens the display that the user named. This is the only place that knows all kinds
// of displays.
#pragma once

#include <memory>
#include <string>
#include <string_view>
#include <vector>

#include "display/clock.h"
#include "display/display.h"
#include "display/kms/scanout/kms_display.h"
#include "display/scanout_depth.h"
#include "display/scanout_recorder.h"
#include "optics/rig.h"

namespace lenticule::display {

struct DisplayRequest {
  /// "virtual", "virtual:3840x2160@59.94", "virtual:3840x2160@60,jitter_us=500", "kms",
  /// "kms:HDMI-A-1", "kms:edid:LGD", "kms:/dev/dri/card1" (see parse_output())
  std::string spec = "virtual";
  /// Size of the frames; a display of another size is refused.
  frames::FrameGeometry panel = {};
  /// Mounting of the panel; the frames are what its viewer sees.
  optics::Mounting mounting = {};
  ScanoutDepth depth = ScanoutDepth::Bits8;  ///< bits per colour in scan-out memory
  /// The panels of a wall on one card; then `panel` is the size of all together.
  std::vector<OutputPart> parts = {};
  /// Virtual displays only: null = real time.
  std::shared_ptr<Clock> clock = nullptr;
  /// Virtual displays only: null = no recording.
  std::shared_ptr<ScanoutRecorder> recorder = nullptr;
  int buffers = 3;
  /// KMS displays only; output, panel, mounting, depth and buffers are taken from above. A
  /// simulated clock or a recorder is not supported there.
  KmsOptions kms = {};
};

/// Returns the depth for a rig whose panel has so many bits per colour.
[[nodiscard]] ScanoutDepth depth_of(int bits);
/// Returns the request for a display of the rig's panel.
[[nodiscard]] DisplayRequest request_for(const optics::Rig& rig, const std::string& spec);

/// Opens the display; the result is a KmsDisplay for a KMS spec. Throws Error(Usage) for an invalid
/// spec, Error(Input) if its size is not the panel's, Error(Device) if there is no such display.
[[nodiscard]] std::unique_ptr<Display> open_display(const DisplayRequest& request);

/// Returns the options for a KMS spec, for callers that open the display themselves. Throws
/// Error(Usage).
[[nodiscard]] KmsOptions kms_options_of(const DisplayRequest& request);

/// Checks the text alone, without opening a display. Throws as open_display() would.
void check_display_spec(std::string_view spec);
/// Returns true if the spec names a panel on a graphics card.
[[nodiscard]] bool is_kms_spec(std::string_view spec);

/// The parts of "virtual[:WxH[@HZ]][,jitter_us=N][,seed=N]".
struct VirtualSpec {
  int width = 0;  ///< 0 = the panel's width
  int height = 0;
  frames::Rate refresh{60, 1};
  int64_t jitter_us = 0;
  uint64_t seed = 1;
  friend bool operator==(const VirtualSpec&, const VirtualSpec&) = default;
};
/// Throws Error(Usage).
[[nodiscard]] VirtualSpec parse_virtual_spec(std::string_view spec);

}  // namespace lenticule::display
