// SPDX-License-Identifier: Apache-2.0
#include "tests/support/oracles/yuv_oracle.h"

#include <algorithm>
#include <array>
#include <cmath>

namespace lenticule::test {
namespace {

/// Converts code values by the formula.
class Converter {
 public:
  explicit Converter(const YuvFormula& formula)
      : formula_(formula),
        one_(std::pow(2.0, formula.depth - 8)),
        most_(std::pow(2.0, formula.depth) - 1.0) {}

  [[nodiscard]] std::array<double, 3> rgb(double y, double cb, double cr) const {
    const auto [kr, kb, full, depth] = formula_;
    const double luma = full ? y / most_ : (y - 16.0 * one_) / (219.0 * one_);
    const double blue = (cb - 128.0 * one_) / (full ? most_ : 224.0 * one_);
    const double red = (cr - 128.0 * one_) / (full ? most_ : 224.0 * one_);
    const double r = luma + 2.0 * (1.0 - kr) * red;
    const double b = luma + 2.0 * (1.0 - kb) * blue;
    return {r, (luma - kr * r - kb * b) / (1.0 - kr - kb), b};
  }

 private:
  YuvFormula formula_;
  double one_, most_;
};

struct Plane {
  const uint8_t* bytes;
  int width;
  int height;
  bool wide;  ///< two bytes per sample

  [[nodiscard]] double at(int x, int y) const {
    const auto i =
        static_cast<size_t>(std::clamp(y, 0, height - 1) * width + std::clamp(x, 0, width - 1));
    return wide ? bytes[2 * i] + 256.0 * bytes[2 * i + 1] : bytes[i];
  }
  [[nodiscard]] double between(double x, double y) const {
    const int left = static_cast<int>(std::floor(x));
    const int top = static_cast<int>(std::floor(y));
    const double fx = x - left;
    const double fy = y - top;
    return (1 - fy) * ((1 - fx) * at(left, top) + fx * at(left + 1, top)) +
           fy * ((1 - fx) * at(left, top + 1) + fx * at(left + 1, top + 1));
  }
};

bool is_rounded(double exact, uint8_t code, double error) {
  const double scaled = 255.0 * exact + 0.5;
  return code >= std::clamp(std::floor(scaled - error), 0.0, 255.0) &&
         code <= std::clamp(std::floor(scaled + error), 0.0, 255.0);
}

}  // namespace

std::optional<std::string> find_wrong_channel(const YuvPicture& picture, const YuvFormula& formula,
                                              const ChromaSampling& sampling, double error) {
  const Converter converter(formula);
  const bool wide = formula.depth > 8;
  const int bytes = wide ? 2 : 1;
  const int cw = (picture.width + sampling.nx - 1) / sampling.nx;
  const int ch = (picture.height + sampling.ny - 1) / sampling.ny;
  const Plane y{picture.planes.data(), picture.width, picture.height, wide};
  const Plane cb{y.bytes + bytes * picture.width * picture.height, cw, ch, wide};
  const Plane cr{cb.bytes + bytes * cw * ch, cw, ch, wide};
  const auto samples = static_cast<size_t>(picture.width * picture.height);
  if (picture.rgb.size() != 3 * samples) return "another number of channels";
  if (picture.planes.size() != static_cast<size_t>(bytes) * (samples + size_t(2 * cw * ch)))
    return "another number of samples";
  for (int j = 0; j < picture.height; ++j)
    for (int i = 0; i < picture.width; ++i) {
      const double x = (i - sampling.site_x) / sampling.nx;
      const double z = (j - sampling.site_y) / sampling.ny;
      const auto exact = converter.rgb(y.at(i, j), cb.between(x, z), cr.between(x, z));
      for (size_t c = 0; c < 3; ++c) {
        const uint8_t code = picture.rgb[static_cast<size_t>(j * picture.width + i) * 3 + c];
        if (!is_rounded(exact[c], code, error))
          return "(" + std::to_string(i) + ", " + std::to_string(j) + ") channel " +
                 std::to_string(c) + ": " + std::to_string(code) + " instead of " +
                 std::to_string(255.0 * exact[c]);
      }
    }
  return std::nullopt;
}

}  // namespace lenticule::test
