// SPDX-License-Identifier: Apache-2.0
#include "calib/measure/grey.h"

#include "base/error.h"
#include "base/parallel_rows.h"

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

}  // namespace lenticule::calib
