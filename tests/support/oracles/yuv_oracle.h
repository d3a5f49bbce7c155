// SPDX-License-Identifier: Apache-2.0
// Converts planes of Y'CbCr samples to RGB by the plain formula in double precision.
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <string>

namespace lenticule::test {

/// The formula of the standards for code values of so many bits.
struct YuvFormula {
  double kr;
  double kb;
  bool full;
  int depth;
};

/// Chroma has a sample for every `nx` by `ny` luma samples, the first one at (site_x, site_y).
struct ChromaSampling {
  int nx = 1;
  int ny = 1;
  double site_x = 0.0;
  double site_y = 0.0;
};

/// Planes of Y', Cb and Cr behind each other, of one byte per sample or two, which `rgb` was
/// converted from.
struct YuvPicture {
  std::span<const uint8_t> planes;
  std::span<const uint8_t> rgb;
  int width;
  int height;
};

/// Returns the place of the first channel that is not the rounded value of the formula; none if all
/// are. `error` is that of a channel before it is rounded, in codes: where the exact value lies so
/// close to the middle between two codes, either is right. Chroma is interpolated linearly between
/// its samples; the outermost ones are repeated.
[[nodiscard]] std::optional<std::string> find_wrong_channel(const YuvPicture& picture,
                                                            const YuvFormula& formula,
                                                            const ChromaSampling& sampling,
                                                            double error);

}  // namespace lenticule::test
