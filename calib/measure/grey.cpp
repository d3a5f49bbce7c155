// SPDX-License-Identifier: Apache-2.0
#include "calib/measure/grey.h"

#include <algorithm>

#include "base/error.h"
#include "base/parallel_rows.h"
#include "base/statistics.h"

namespace lenticule::calib {

GreyPicture grey_of(const CameraPicture& picture, const ChannelWeights& weights) {
  GreyPicture grey{.width = picture.width, .height = picture.height, .light = {}, .clipped = {}};
  const size_t count = static_cast<size_t>(picture.width) * static_cast<size_t>(picture.height);
  const auto channels = static_cast<size_t>(picture.channels);
  LENTICULE_CHECK((channels == 1 || channels == 3) && picture.light.size() == count * channels);
  grey.light.resize(count);
  grey.clipped.resize(count);
  for_rows(picture.height, [&](int j) {
    const size_t begin = static_cast<size_t>(j) * static_cast<size_t>(picture.width);
    for (size_t i = begin; i < begin + static_cast<size_t>(picture.width); ++i) {
      const float* light = picture.light.data() + i * channels;
      float sum = light[0];
      float most = light[0];
      if (channels == 3) {
        sum = weights[0] * light[0] + weights[1] * light[1] + weights[2] * light[2];
        most = std::max({light[0], light[1], light[2]});
      }
      grey.light[i] = sum;
      grey.clipped[i] = most >= kSaturatedLight ? 1 : 0;
    }
  });
  return grey;
}

namespace {

constexpr float kLeastLight = 0.15F;  ///< fraction of the light of a bright panel pixel
constexpr double kBrightPart = 0.98;

}  // namespace

std::vector<uint32_t> visible_pixels(const GreyPicture& dark, const GreyPicture& white) {
  std::vector<float> rise(white.size());
  for (size_t i = 0; i < rise.size(); ++i) rise[i] = white.light[i] - dark.light[i];
  const float bright =
      value_in_order(rise, static_cast<size_t>(kBrightPart * static_cast<double>(rise.size())));
  std::vector<uint32_t> pixels;
  for (size_t i = 0; i < rise.size(); ++i)
    if (rise[i] > kLeastLight * bright && dark.clipped[i] == 0 && white.clipped[i] == 0)
      pixels.push_back(static_cast<uint32_t>(i));
  return pixels;
}

double part_of(const std::vector<uint32_t>& pixels, const GreyPicture& picture) {
  return picture.size() == 0
             ? 0.0
             : static_cast<double>(pixels.size()) / static_cast<double>(picture.size());
}

double mean_of(const GreyPicture& picture, const std::vector<uint32_t>& pixels) {
  double sum = 0.0;
  for (const uint32_t i : pixels) sum += picture.light[i];
  return pixels.empty() ? 0.0 : sum / static_cast<double>(pixels.size());
}

}  // namespace lenticule::calib
