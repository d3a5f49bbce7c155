// SPDX-License-Identifier: Apache-2.0
#include "calib/photo/averaged_photo.h"

#include <algorithm>
#include <array>

namespace lenticule::calib {
namespace {

constexpr int kMostSide = 2600;

/// Appends the mean light of a square of pixels, and that of each channel, to the picture.
void append_mean(const CameraPicture& photograph, int left, int top, int side, PhotoLight& out) {
  float sum = 0.0F;
  std::array<float, 3> colours{};
  int clipped = 0;
  const auto channels = static_cast<size_t>(photograph.channels);
  for (int j = top; j < top + side; ++j) {
    const size_t row = static_cast<size_t>(j) * static_cast<size_t>(photograph.width);
    const size_t first = (row + static_cast<size_t>(left)) * channels;
    for (size_t k = first; k < first + static_cast<size_t>(side) * channels; ++k) {
      sum += photograph.light[k];
      clipped += photograph.light[k] >= kSaturatedLight ? 1 : 0;
      if (channels == colours.size()) colours[k % channels] += photograph.light[k];
    }
  }
  const int values = side * side * photograph.channels;
  out.light.push_back(sum / static_cast<float>(values));
  out.clipped.push_back(static_cast<uint8_t>(255 * clipped / values));
  for (float& colour : colours) colour /= static_cast<float>(side * side);
  if (channels == colours.size()) out.colours.push_back(colours);
}

}  // namespace

PhotoPriors AveragedPhoto::scaled(PhotoPriors priors) const {
  if (priors.focal_px) {
    priors.focal_px->value /= averaged;
    priors.focal_px->sigma /= averaged;
  }
  return priors;
}

AveragedPhoto average_down(const CameraPicture& photograph) {
  AveragedPhoto out;
  const int longer = std::max(photograph.width, photograph.height);
  out.averaged = std::max((longer + kMostSide - 1) / kMostSide, 1);
  PhotoLight& picture = out.light;
  picture.width = photograph.width / out.averaged;
  picture.height = photograph.height / out.averaged;
  const size_t count = static_cast<size_t>(picture.width) * static_cast<size_t>(picture.height);
  picture.light.reserve(count);
  picture.clipped.reserve(count);
  for (int j = 0; j < picture.height; ++j)
    for (int i = 0; i < picture.width; ++i)
      append_mean(photograph, i * out.averaged, j * out.averaged, out.averaged, picture);
  return out;
}

}  // namespace lenticule::calib
