// SPDX-License-Identifier: Apache-2.0
#include "apps/lenticule-tools/calibrate/camera_preview.h"

#include <fmt/format.h>

#include <algorithm>

#include "base/statistics.h"
#include "frames/image_io.h"
#include "frames/srgb.h"

namespace lenticule::tools {
namespace {

constexpr int kPreviewWidth = 960;
constexpr double kBrightPart = 0.99;

float light_at(const calib::CameraPicture& picture, int x, int y, int channel) {
  const auto channels = static_cast<size_t>(picture.channels);
  const size_t pixel =
      static_cast<size_t>(y) * static_cast<size_t>(picture.width) + static_cast<size_t>(x);
  return picture.light[pixel * channels + std::min(static_cast<size_t>(channel), channels - 1)];
}

}  // namespace

void write_picture(const calib::CameraPicture& picture, const std::string& file) {
  const int step = std::max(1, (picture.width + kPreviewWidth - 1) / kPreviewWidth);
  frames::WovenFrame small({.width = picture.width / step, .height = picture.height / step});
  for (int y = 0; y < small.height(); ++y)
    for (int x = 0; x < small.width(); ++x)
      for (int c = 0; c < 3; ++c) {
        float sum = 0.0F;
        for (int v = 0; v < step; ++v)
          for (int u = 0; u < step; ++u) sum += light_at(picture, x * step + u, y * step + v, c);
        small.row(y)[3 * x + c] =
            frames::code_from_linear(double{sum} / static_cast<double>(step * step));
      }
  frames::write_woven(small.view(), file);
}

bool write_preview(calib::Camera& camera, const std::string& file) {
  calib::CameraPicture picture;
  if (camera.grab(picture, std::chrono::seconds(1)) != calib::GrabStatus::Ready) return false;
  write_picture(picture, file);
  return true;
}

std::string light_of(const calib::CameraPicture& picture) {
  const std::vector<float>& light = picture.light;
  if (light.empty()) return "no light measured";
  const auto clipped =
      std::ranges::count_if(light, [](float v) { return v >= calib::kSaturatedLight; });
  return fmt::format("brightest {:.0f} % of full scale, clipped {:.1f} % of the picture",
                     100.0 * double{quantile(light, kBrightPart)},
                     100.0 * static_cast<double>(clipped) / static_cast<double>(light.size()));
}

}  // namespace lenticule::tools
