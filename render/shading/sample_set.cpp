// SPDX-License-Identifier: Apache-2.0
#include "render/shading/sample_set.h"

namespace lenticule::render::sampling {
namespace {

/// 2^32 divided by the golden ratio: far from every simple pattern.
constexpr uint32_t kGolden = 0x9e3779b9U;

}  // namespace

uint32_t mixed(uint32_t bits) {
  bits ^= bits >> 16;
  bits *= 0x7feb352dU;
  bits ^= bits >> 15;
  bits *= 0x846ca68bU;
  return bits ^ bits >> 16;
}

uint32_t subpixel_seed(int row, int subpixel, int sample) {
  const uint32_t in_row = mixed(static_cast<uint32_t>(row) + kGolden);
  const uint32_t in_panel = mixed(in_row + static_cast<uint32_t>(subpixel));
  return mixed(in_panel + static_cast<uint32_t>(sample));
}

uint32_t longer_path(uint32_t path, Turn turn) {
  return mixed(path * kGolden + static_cast<uint32_t>(turn));
}

SampleSet sample_set(std::span<const uint32_t, 16> seeds, uint32_t path, uint32_t use) {
  const uint32_t key = mixed(path + use * kGolden);
  SampleSet set;
  for (size_t r = 0; r < 16; ++r) {
    set.scramble[0][r] = mixed(seeds[r] ^ key);
    set.scramble[1][r] = mixed(set.scramble[0][r] + kGolden);
  }
  return set;
}

Sample sample_of(const SampleSet& set, uint32_t index) {
  // Row k of Pascal's triangle modulo 2 corresponds to bit k of the index.
  uint32_t second = 0;
  for (uint32_t left = index, row = 1; left != 0; left >>= 1, row ^= row << 1)
    if ((left & 1) != 0) second ^= row;
  return {&set, index, second};
}

}  // namespace lenticule::render::sampling
