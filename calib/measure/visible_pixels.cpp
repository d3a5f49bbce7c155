// SPDX-License-Identifier: Apache-2.0
#include "calib/measure/visible_pixels.h"

#include <algorithm>

#include "base/statistics.h"

namespace lenticule::calib {
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
