// SPDX-License-Identifier: Apache-2.0
// A camera's picture reduced to one number per pixel.
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "calib/camera.h"

namespace lenticule::calib {

/// Rows from the top; linear light. `clipped` is not 0 where any channel of the camera was.
struct GreyPicture {
  int width = 0;
  int height = 0;
  std::vector<float> light;
  std::vector<uint8_t> clipped;

  [[nodiscard]] size_t size() const { return light.size(); }
};

/// How much each channel of the camera counts; sums to 1.
using ChannelWeights = std::array<float, 3>;
inline constexpr ChannelWeights kEqualWeights{1.0F / 3.0F, 1.0F / 3.0F, 1.0F / 3.0F};

/// The weighted sum of the camera's channels; a camera with one channel is taken as it is.
[[nodiscard]] GreyPicture grey_of(const CameraPicture& picture,
                                  const ChannelWeights& weights = kEqualWeights);

}  // namespace lenticule::calib
