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

// Selects the camera pixels that see the panel well enough for measuring.

/// Returns the pixels whose light differs between a white and a dark panel by a large part of the
/// panel's typical difference, and that are clipped in neither picture. This excludes the
/// surroundings of the panel, reflections and dead areas.
[[nodiscard]] std::vector<uint32_t> visible_pixels(const GreyPicture& dark,
                                                   const GreyPicture& white);

/// Returns the fraction of a picture's pixels, for messages.
[[nodiscard]] double part_of(const std::vector<uint32_t>& pixels, const GreyPicture& picture);

/// Returns the mean light of the pixels.
[[nodiscard]] double mean_of(const GreyPicture& picture, const std::vector<uint32_t>& pixels);

}  // namespace lenticule::calib
