// SPDX-License-Identifier: Apache-2.0
// GreyPicture is a camera's picture reduced to one value per pixel.
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "calib/camera.h"

namespace lenticule::calib {

/// Rows from the top; linear light. `clipped` is not 0 where any channel of the camera was clipped.
struct GreyPicture {
  int width = 0;
  int height = 0;
  std::vector<float> light;
  std::vector<uint8_t> clipped;

  [[nodiscard]] size_t size() const { return light.size(); }
};

/// Weights of the camera's channels; they sum to 1.
using ChannelWeights = std::array<float, 3>;
inline constexpr ChannelWeights kEqualWeights{1.0F / 3.0F, 1.0F / 3.0F, 1.0F / 3.0F};

/// Returns the weighted sum of the camera's channels; a picture with one channel is unchanged.
[[nodiscard]] GreyPicture grey_of(const CameraPicture& picture,
                                  const ChannelWeights& weights = kEqualWeights);

}  // namespace lenticule::calib
