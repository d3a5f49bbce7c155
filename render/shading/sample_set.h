// SPDX-License-Identifier: Apache-2.0
// Sample points for soft light: the first points of Sobol's two-dimensional sequence, with random
// digit scrambling (Owen) that differs between subpixels, bounces and uses. So the points of one
// subpixel are spread evenly, and the errors of two subpixels are uncorrelated.
//
// All computation is in integers, so the points are the same on every machine. Thread safety: all
// functions may be called from any thread.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>

#include "render/shading/sample_data.h"

namespace lenticule::render::sampling {

/// Returns a hash in which every input bit affects all bits.
[[nodiscard]] uint32_t mixed(uint32_t bits);

/// Returns a seed that is specific to a subpixel. It does not contain the frame number, since still
/// pictures must not flicker. `sample` numbers the rays inside the subpixel
/// (RenderOptions::samples).
[[nodiscard]] uint32_t subpixel_seed(int row, int subpixel, int sample);

/// Path ids, which distinguish the bounces of a subpixel's rays: each id encodes the sequence of
/// mirrored and refracted rays from the eye.
inline constexpr uint32_t kFirstPath = 1;
enum class Turn : uint32_t { Mirrored, Refracted };
[[nodiscard]] uint32_t longer_path(uint32_t path, Turn turn);

/// Uses of samples.
inline constexpr uint32_t kUseAmbient = 0;
[[nodiscard]] constexpr uint32_t use_of_light(size_t light) {
  return 1 + static_cast<uint32_t>(light);
}

[[nodiscard]] SampleSet sample_set(std::span<const uint32_t, 16> seeds, uint32_t path,
                                   uint32_t use);
/// Returns point `index` of the set. Lifetime: `set` must outlive the sample.
[[nodiscard]] Sample sample_of(const SampleSet& set, uint32_t index);

}  // namespace lenticule::render::sampling
