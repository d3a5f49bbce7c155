// SPDX-License-Identifier: Apache-2.0
// Does the link hand every subpixel through? And how does the camera see the panel's colours?
#pragma once

#include <array>

#include "calib/calibration.h"
#include "calib/measure/grey.h"

namespace lenticule::calib {

/// Mean light of the camera's channels over the panel, room light taken off.
using MeanColour = std::array<double, 3>;

struct LinkPictures {
  int camera_channels = 0;
  MeanColour white{};
  std::array<MeanColour, 3> flat{};     ///< the panel's red, green and blue, each alone
  std::array<MeanColour, 3> columns{};  ///< the same, every other column of pixels dark
  MeanColour checks{};                  ///< squares of one pixel
};

/// How the camera's channels are best put together to see one colour of the panel: as they respond
/// to it.
[[nodiscard]] ChannelWeights weights_for(const LinkPictures& pictures, int panel_channel);

/// chroma_subsampled, scaled, chroma_leak and their findings.
[[nodiscard]] LinkCheck check_link(const LinkPictures& pictures);

}  // namespace lenticule::calib
