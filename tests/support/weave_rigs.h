// SPDX-License-Identifier: Apache-2.0
// Provides rigs, difficult pictures and settings for tests of weaving.
#pragma once

#include <array>
#include <cstdint>
#include <span>

#include "frames/frame.h"
#include "frames/weave.h"
#include "optics/rig.h"

namespace lenticule::test {

/// Returns noise with many adjacent black and white pixels, which are the hardest to weave.
[[nodiscard]] frames::WovenFrame weave_noise(int width, int height, uint32_t seed);

/// Returns cells of two columns with colours at different heights.
[[nodiscard]] optics::SubpixelLayout two_over_one();

/// Returns a rig with pixels of 0.2 mm, pitch in subpixels, distance in mm.
[[nodiscard]] optics::Rig weave_rig(
    int width, int height, double pitch, double slant, double distance,
    const optics::SubpixelLayout& layout = optics::SubpixelLayout::rgb());

/// A weaving setting for a quilt whose tiles have 7 x 5 pixels.
struct WeaveSetting {
  frames::QuiltLayout layout;
  frames::WeaveOptions options;

  [[nodiscard]] frames::WovenFrame noise() const;
};
/// Returns all filters, fits and orders, from one view to more than 64.
[[nodiscard]] std::span<const WeaveSetting> weave_settings();

}  // namespace lenticule::test
