// SPDX-License-Identifier: Apache-2.0
#include "apps/lenticule-bench/phone/development.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <vector>

namespace lenticule::bench {
namespace {

/// Picture is linear light with three channels.
struct Picture {
  int width = 0, height = 0;
  std::vector<float> light;
  [[nodiscard]] float* at(int i, int j) {
    return light.data() + 3 * (static_cast<ptrdiff_t>(j) * width + i);
  }
};

/// Adds a second exposure that the hand's motion moved by some pixels.
void merge_moved(Mosaic& mosaic) {
  const SensorWindow& window = mosaic.window;
  std::vector<float>& light = mosaic.light;
  constexpr int kRight = 4, kDown = 2;  // even: the channels of the mosaic agree
  for (int j = window.height() - 1; j >= kDown; --j)
    for (int i = window.width() - 1; i >= kRight; --i) {
      const auto at =
          static_cast<size_t>(j) * static_cast<size_t>(window.width()) + static_cast<size_t>(i);
      const auto from = static_cast<size_t>(j - kDown) * static_cast<size_t>(window.width()) +
                        static_cast<size_t>(i - kRight);
      light[at] = 0.5F * (light[at] + light[from]);
    }
}

/// Interpolates the mosaic bilinearly.
Picture without_mosaic(const Mosaic& mosaic) {
  const SensorWindow& window = mosaic.window;
  const std::vector<float>& light = mosaic.light;
  Picture out{window.width(), window.height(), {}};
  out.light.resize(light.size() * 3);
  const auto inside = [](int k, int size) {  // mirrors, so that the channel stays the same
    return k < 0 ? -k : k >= size ? 2 * size - 2 - k : k;
  };
  const auto raw = [&](int i, int j) {
    return light[static_cast<size_t>(inside(j, out.height)) * static_cast<size_t>(out.width) +
                 static_cast<size_t>(inside(i, out.width))];
  };
  for (int j = 0; j < out.height; ++j)
    for (int i = 0; i < out.width; ++i) {
      const int own = mosaic_channel(i + window.left, j + window.top);
      const float sides = 0.5F * (raw(i - 1, j) + raw(i + 1, j));
      const float ends = 0.5F * (raw(i, j - 1) + raw(i, j + 1));
      float* p = out.at(i, j);
      p[own] = raw(i, j);
      if (own == 1) {
        const bool red_beside = (j + window.top) % 2 == 0;
        p[0] = red_beside ? sides : ends;
        p[2] = red_beside ? ends : sides;
      } else {
        p[1] = 0.5F * (sides + ends);
        p[2 - own] =
            0.25F * (raw(i - 1, j - 1) + raw(i + 1, j - 1) + raw(i - 1, j + 1) + raw(i + 1, j + 1));
      }
    }
  return out;
}

/// Brightens dark regions as phones do: by a power of the mean light around each pixel, which is
/// taken from squares of 64 pixels.
void map_tones(Picture& picture, double exponent) {
  constexpr int kSquare = 64;
  const int columns = picture.width / kSquare + 2, rows = picture.height / kSquare + 2;
  std::vector<float> gain(static_cast<size_t>(columns * rows), 1.0F);
  for (int r = 0; r < rows; ++r)
    for (int c = 0; c < columns; ++c) {
      double sum = 0.0;
      int count = 0;
      for (int j = (r - 1) * kSquare; j < (r + 1) * kSquare; j += 4)
        for (int i = (c - 1) * kSquare; i < (c + 1) * kSquare; i += 4)
          if (i >= 0 && j >= 0 && i < picture.width && j < picture.height) {
            sum += double{picture.at(i, j)[1]};
            ++count;
          }
      constexpr double kUsual = 0.3;
      const double mean = std::max(sum / std::max(count, 1), 0.02);
      gain[static_cast<size_t>(r * columns + c)] =
          static_cast<float>(std::pow(mean / kUsual, -exponent));
    }
  for (int j = 0; j < picture.height; ++j)
    for (int i = 0; i < picture.width; ++i) {
      const int c = i / kSquare, r = j / kSquare;
      const float x = static_cast<float>(i % kSquare) / kSquare;
      const float y = static_cast<float>(j % kSquare) / kSquare;
      const float* g = gain.data() + static_cast<ptrdiff_t>(r) * columns + c;
      const float factor =
          (1 - y) * ((1 - x) * g[0] + x * g[1]) + y * ((1 - x) * g[columns] + x * g[columns + 1]);
      for (int k = 0; k < 3; ++k) picture.at(i, j)[k] *= factor;
    }
}

/// CodeCurve converts light to codes between 0 and 255: sRGB, then an S-shaped curve.
class CodeCurve {
 public:
  explicit CodeCurve(double strength) {
    for (size_t k = 0; k < values_.size(); ++k) {
      const double light = static_cast<double>(k) / static_cast<double>(values_.size() - 1);
      const double code =
          light <= 0.0031308 ? 12.92 * light : 1.055 * std::pow(light, 1 / 2.4) - 0.055;
      values_[k] =
          static_cast<float>(255.0 * (code - strength * std::sin(2.0 * std::numbers::pi * code) /
                                                 (2.0 * std::numbers::pi) * 2.0));
    }
  }
  [[nodiscard]] float code(float light) const {
    const float at = std::clamp(light, 0.0F, 1.0F) * static_cast<float>(values_.size() - 1);
    return values_[static_cast<size_t>(at + 0.5F)];
  }

 private:
  std::array<float, 1 << 14> values_{};
};

/// Sharpens the codes of a window and writes them into the photograph.
void sharpen_into(Picture& codes, double strength, const SensorWindow& window, Photo& photo) {
  const auto part = static_cast<float>(strength);
  for (int j = 0; j < codes.height; ++j) {
    const int above = std::max(j - 1, 0), below = std::min(j + 1, codes.height - 1);
    uint8_t* row = photo.codes.data() +
                   3 * (static_cast<size_t>(j + window.top) * static_cast<size_t>(photo.width) +
                        static_cast<size_t>(window.left));
    for (int i = 0; i < codes.width; ++i) {
      const int left = std::max(i - 1, 0), right = std::min(i + 1, codes.width - 1);
      for (int k = 0; k < 3; ++k) {
        const float own = codes.at(i, j)[k];
        const float blurred = 0.25F * own +
                              0.125F * (codes.at(left, j)[k] + codes.at(right, j)[k] +
                                        codes.at(i, above)[k] + codes.at(i, below)[k]) +
                              0.0625F * (codes.at(left, above)[k] + codes.at(right, above)[k] +
                                         codes.at(left, below)[k] + codes.at(right, below)[k]);
        *row++ =
            static_cast<uint8_t>(std::clamp(own + part * (own - blurred) + 0.5F, 0.0F, 255.0F));
      }
    }
  }
}

}  // namespace

Photo develop(Mosaic mosaic, const Phone& phone, bool hdr) {
  if (hdr) merge_moved(mosaic);
  Picture picture = without_mosaic(mosaic);
  map_tones(picture, hdr ? 0.5 : phone.tone_mapping);
  const CodeCurve curve(phone.curve);
  for (float& value : picture.light) value = curve.code(value);
  Photo photo;
  photo.width = phone.width;
  photo.height = phone.height;
  photo.codes.assign(static_cast<size_t>(phone.width) * static_cast<size_t>(phone.height) * 3,
                     static_cast<uint8_t>(curve.code(kWallLight)));
  sharpen_into(picture, phone.sharpening, mosaic.window, photo);
  return photo;
}

}  // namespace lenticule::bench
