// SPDX-License-Identifier: Apache-2.0
// Where sampled light is looked for: the first points of Sobol's two-dimensional sequence, whose
// digits are scrambled at random (Owen) in a way of its own for every subpixel, generation of rays
// and use. So the points of one subpixel are spread evenly, and the errors of two subpixels have
// nothing to do with each other.
//
// Whole numbers throughout: the same points on every machine. Functions for any thread.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>

#include "render/shading/sample_data.h"

namespace lenticule::render::sampling {

/// Spreads over all bits what differs in any.
[[nodiscard]] uint32_t mixed(uint32_t bits);

/// What sets one subpixel apart from the others; no frame number, for still pictures must not
/// flicker. `sample` counts the rays inside the subpixel (RenderOptions::samples).
[[nodiscard]] uint32_t subpixel_seed(int row, int subpixel, int sample);

/// What sets the generations of a subpixel's rays apart: the way from the eye, by mirrored and
/// refracted rays.
inline constexpr uint32_t kFirstPath = 1;
enum class Turn : uint32_t { Mirrored, Refracted };
[[nodiscard]] uint32_t longer_path(uint32_t path, Turn turn);

/// What samples are taken of.
inline constexpr uint32_t kUseAmbient = 0;
[[nodiscard]] constexpr uint32_t use_of_light(size_t light) {
  return 1 + static_cast<uint32_t>(light);
}

[[nodiscard]] SampleSet sample_set(std::span<const uint32_t, 16> seeds, uint32_t path,
                                   uint32_t use);
/// Point `index` of the set, which must stay.
[[nodiscard]] Sample sample_of(const SampleSet& set, uint32_t index);

}  // namespace lenticule::render::sampling
