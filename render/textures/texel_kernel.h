// SPDX-License-Identifier: Apache-2.0
// Looks up a texture in sixteen lanes, compiled once per instruction set. Plain data only: this
// header must not bring shared inline functions into a file that is compiled for AVX-512. The
// results have the same bits on every instruction set.
//
// A look-up is the mean over a parallelogram, which an ellipse around it stands for: several places
// along the longer axis, and at each place the mean of two levels of the texture, whose texels are
// as wide as the shorter axis.
#pragma once

#include <cstdint>

#include "base/cpu.h"

namespace lenticule::render::texel_kernel {

inline constexpr int kLanes = 16;
/// Largest number of places of a look-up; longer ellipses are blurred across as well.
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

struct TextureLevels {
  const Level* levels;  ///< the texture itself comes first
  int32_t count;        ///< number of levels
  Content content;
  const float* light_of_code;    ///< linear light of the 256 codes of colours
  int32_t repeat[2], mirror[2];  ///< flags for u and v: how it continues beyond its border
};

/// Area holds the middle and the sides of parallelograms, in texture coordinates.
struct alignas(64) Area {
  double middle[2][kLanes];  ///< u and v
  float across[2][kLanes], along[2][kLanes];
};

/// Values holds four channels of each lane.
struct alignas(64) Values {
  float channel[4][kLanes];
};

/// Corners holds the four texels around a place, in one level.
struct alignas(64) Corners {
  int32_t texel[4]
               [kLanes];  ///< numbers of texels: upper left, upper right, lower left, lower right
  float right[kLanes];    ///< weight of the right texels
  float below[kLanes];    ///< weight of the lower texels
};

struct alignas(64) Lookup {
  int32_t places[kLanes];   ///< number of places
  int32_t level[kLanes];    ///< number of the finer level
  float of_coarse[kLanes];  ///< weight of the next level
  int32_t any_coarse;  ///< 0: all weights are zero, and the corners in the coarser level not set
  Corners fine[kPlaces], coarse[kPlaces];
};

struct Kernel {
  /// Finds the texels of a look-up per lane. Coordinates that are not
  /// finite, or from 1e15 on, count as 0.
  void (*find)(const TextureLevels&, const Area&, Lookup&);
  /// Computes the mean of each lane; 0 in lanes without places. `lookup` must have been made for a
  /// texture of the same size.
  void (*mean)(const TextureLevels&, const Lookup& lookup, Values& out);
};

}  // namespace lenticule::render::texel_kernel

namespace lenticule::render {
LENTICULE_DECLARE_KERNEL(texel_kernel::Kernel, kTexelKernel)
}
