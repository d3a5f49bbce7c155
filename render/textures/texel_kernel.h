// SPDX-License-Identifier: Apache-2.0
// Means of texels around several places of a texture, compiled once per instruction set. Plain data
// only: this header must not bring shared inline functions into a file that is compiled for
// AVX-512. The results have the same bits on every instruction set.
#pragma once

#include <cstdint>

#include "base/cpu.h"

namespace lenticule::render::texel_kernel {

/// Largest number of places in a texture whose texels one look-up averages.
inline constexpr int kPlaces = 16;

/// The meaning of the texels. Colours are averaged as light, and 8-bit colours are sRGB-encoded.
/// Texels of normal maps are unit vectors (RGB = 1/2 + vector / 2); their levels hold in the fourth
/// channel how much the vectors differ.
enum class Content : int32_t { Colour, Data, Normals };

/// Level is one level of a texture, with four channels per texel: 8-bit codes or, if these are
/// null, values.
struct Level {
  int32_t width, height;
  const uint8_t* codes;
  const float* values;
  int32_t is_first;  ///< 1 for the texture itself, else 0
};

/// Corners holds the four texels around a place, in one level.
struct Corners {
  int32_t texel[4];  ///< numbers of texels: upper left, upper right, lower left, lower right
  float right;       ///< weight of the right texels
  float below;       ///< weight of the lower texels
};

struct Lookup {
  int32_t places;   ///< number of places
  float of_coarse;  ///< weight of the coarser level; 0: its corners are not set
  Corners fine[kPlaces], coarse[kPlaces];
};

/// Path holds what the corners of a look-up depend on. Coordinates are (u, v).
struct Path {
  double middle[2];  ///< coordinates of the middle of all places
  double length[2];  ///< way from the first place to the last, and one distance of neighbours more
  int32_t repeat[2], mirror[2];          ///< flags: how Texture continues beyond its border
  int32_t fine_size[2], coarse_size[2];  ///< texels of both levels
};

struct Kernel {
  /// Finds the corners of `lookup.places` places, in the coarser level as well if it has a weight.
  /// Non-finite coordinates count as 0.
  void (*find)(const Path& path, Lookup& lookup);
  /// Writes the mean over the places, four channels. `light_of_code` holds the linear light of the
  /// 256 codes of colours.
  void (*mean)(Content content, const float* light_of_code, const Level& fine, const Level& coarse,
               const Lookup& lookup, float* out);
};

}  // namespace lenticule::render::texel_kernel

namespace lenticule::render {
LENTICULE_DECLARE_KERNEL(texel_kernel::Kernel, kTexelKernel)
}
