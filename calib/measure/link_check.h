// SPDX-License-Identifier: Apache-2.0
// Checks that the link transmits every subpixel, and measures the camera's response to the panel's
// colours.
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "calib/calibration.h"
#include "calib/measure/grey.h"

namespace lenticule::calib {

/// Mean light of the camera's channels over the panel, without ambient light.
using MeanColour = std::array<double, 3>;

/// Returns the mean light of pixels, without that of the dark panel.
[[nodiscard]] MeanColour mean_colour(const CameraPicture& picture, const CameraPicture& dark,
                                     const std::vector<uint32_t>& pixels);

struct LinkPictures {
  int camera_channels = 0;
  MeanColour white{};
  std::array<MeanColour, 3> flat{};     ///< the panel's red, green and blue, each alone
  std::array<MeanColour, 3> columns{};  ///< the same colours, every other column of pixels dark
  MeanColour checks{};                  ///< squares of one pixel
};

/// Returns the channel weights with which the camera sees one colour of the panel best:
/// proportional to the channels' response to the colour.
[[nodiscard]] ChannelWeights weights_for(const LinkPictures& pictures, int panel_channel);

/// Computes chroma_subsampled, scaled, chroma_leak and their findings.
[[nodiscard]] LinkCheck check_link(const LinkPictures& pictures);

}  // namespace lenticule::calib
