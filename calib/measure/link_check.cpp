// SPDX-License-Identifier: Apache-2.0
#include "calib/measure/link_check.h"

#include <fmt/format.h>

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>

namespace lenticule::calib {
namespace {

/// Intact links leak well below 2 %; chroma subsampling leaks 20 % and more.
constexpr double kMostLeak = 0.08;
/// Half of the pixels lit give half of the light; scaling mixes codes, whose mean is much darker.
constexpr double kMostImbalance = 0.08;

double total(const MeanColour& colour) {
  return colour[0] + colour[1] + colour[2];
}

/// Returns the light of the panel's channels that gives the camera's channels.
Eigen::Vector3d panel_light(const LinkPictures& pictures, const MeanColour& seen) {
  Eigen::Matrix3d response;
  for (int d = 0; d < 3; ++d)
    for (int c = 0; c < 3; ++c)
      response(c, d) = pictures.flat[static_cast<size_t>(d)][static_cast<size_t>(c)];
  return response.colPivHouseholderQr().solve(Eigen::Vector3d(seen[0], seen[1], seen[2]));
}

/// Returns the light in the two channels that should be dark, relative to the lit channel.
double leak_of(const LinkPictures& pictures, int channel) {
  const Eigen::Vector3d light =
      panel_light(pictures, pictures.columns[static_cast<size_t>(channel)]);
  double others = 0.0;
  for (int d = 0; d < 3; ++d)
    if (d != channel) others += std::abs(light[d]);
  return light[channel] > 0.0 ? others / light[channel] : 1.0;
}

}  // namespace

MeanColour mean_colour(const CameraPicture& picture, const CameraPicture& dark,
                       const std::vector<uint32_t>& pixels) {
  MeanColour sum{};
  const auto channels = static_cast<size_t>(picture.channels);
  for (const uint32_t i : pixels)
    for (size_t c = 0; c < 3; ++c) {
      const size_t at = i * channels + std::min(c, channels - 1);
      sum[c] += double{picture.light[at]} - double{dark.light[at]};
    }
  for (double& s : sum) s /= static_cast<double>(std::max<size_t>(1, pixels.size()));
  return sum;
}

ChannelWeights weights_for(const LinkPictures& pictures, int panel_channel) {
  const MeanColour& seen = pictures.flat[static_cast<size_t>(panel_channel)];
  const double sum = std::max(seen[0], 0.0) + std::max(seen[1], 0.0) + std::max(seen[2], 0.0);
  if (pictures.camera_channels != 3 || !(sum > 0.0)) return kEqualWeights;
  ChannelWeights weights{};
  for (size_t c = 0; c < 3; ++c) weights[c] = static_cast<float>(std::max(seen[c], 0.0) / sum);
  return weights;
}

LinkCheck check_link(const LinkPictures& pictures) {
  LinkCheck check;
  double worst_half = 0.0;
  for (int d = 0; d < 3; ++d) {
    const auto k = static_cast<size_t>(d);
    const double half = total(pictures.columns[k]) / std::max(total(pictures.flat[k]), 1e-9);
    worst_half = std::max(worst_half, std::abs(half - 0.5));
    if (pictures.camera_channels == 3)
      check.chroma_leak = std::max(check.chroma_leak, leak_of(pictures, d));
  }
  check.chroma_subsampled = check.chroma_leak > kMostLeak || worst_half > 2.0 * kMostImbalance;
  if (check.chroma_subsampled)
    check.findings.push_back(fmt::format(
        "The link does not transmit the colour of every pixel (4:2:0 or 4:2:2): columns of one "
        "colour leak {:.0f} % into the others. Set the output to RGB or 4:4:4 at full range.",
        100.0 * check.chroma_leak));
  const double checks = total(pictures.checks) / std::max(total(pictures.white), 1e-9);
  check.scaled = std::abs(checks - 0.5) > kMostImbalance && !check.chroma_subsampled;
  if (check.scaled)
    check.findings.push_back(fmt::format(
        "Squares of one pixel give {:.0f} % of white light instead of 50 %: the panel scales or "
        "sharpens the picture. Use its own resolution and switch its picture processing off.",
        100.0 * checks));
  return check;
}

}  // namespace lenticule::calib
