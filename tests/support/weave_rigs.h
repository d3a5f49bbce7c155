// SPDX-License-Identifier: Apache-2.0
// What tests of weaving have in common: rigs, pictures that are hard to weave, ways to weave them.
#pragma once

#include <array>
#include <cstdint>
#include <span>

#include "frames/frame.h"
#include "frames/weave.h"
#include "optics/rig.h"

namespace lenticule::test {

/// Black and white beside each other are the hardest; anything else occurs too.
[[nodiscard]] frames::WovenFrame weave_noise(int width, int height, uint32_t seed);

/// Cells of two columns with colours at different heights.
[[nodiscard]] optics::SubpixelLayout two_over_one();

/// Pixels of 0.2 mm, pitch in subpixels, distance in mm.
[[nodiscard]] optics::Rig weave_rig(
    int width, int height, double pitch, double slant, double distance,
    const optics::SubpixelLayout& layout = optics::SubpixelLayout::rgb());

/// A quilt's tiles are to have 7 x 5 pixels.
struct WeaveSetting {
  frames::QuiltLayout layout;
  frames::WeaveOptions options;

  [[nodiscard]] frames::WovenFrame noise() const;
};
/// All filters, fits and orders, from one view to more than 64.
[[nodiscard]] std::span<const WeaveSetting> weave_settings();

}  // namespace lenticule::test
