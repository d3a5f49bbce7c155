// SPDX-License-Identifier: Apache-2.0
// Points seen through one lens, found again through another: the inner loops of the methods that
// reuse points, compiled once per instruction set. Plain data only: nothing here may bring a shared
// inline function into a file that is compiled for AVX-512.
//
// All rays of one row and channel lie in one plane. In it a ray is x = glass_x + tan z, in
// millimetres of the panel frame, z toward the viewer.
#pragma once

#include <cstdint>

#include "base/cpu.h"

namespace lenticule::render::reprojection {

inline constexpr int kLanes = 16;    ///< rows of a tile
inline constexpr int kChannels = 3;  ///< columns from one subpixel to the next of its channel

/// What a subpixel holds.
enum Flag : int32_t {
  kOutside,       ///< not on the panel, or its ray is not finite
  kEmpty,         ///< nothing yet
  kProjected,     ///< a point of another micro-image or frame
  kInterpolated,  ///< the mean of two neighbours; no point of any surface
  kTraced,
};

/// What is found where a ray goes on for ever: parallel within single precision.
inline constexpr float kSkyZ = -1e5F;
inline constexpr int32_t kSky = -1;  ///< as surface

/// The point image and the pixel image of one column of a tile: sixteen subpixels.
struct alignas(64) Column {
  float glass_x[kLanes];  ///< of the subpixel's ray
  float tan[kLanes];
  int32_t lens[kLanes];
  int32_t flag[kLanes];     ///< Flag
  int32_t missing[kLanes];  ///< -1 where re-projection brought nothing
  float x[kLanes];          ///< of the point, where it truly lies
  float z[kLanes];          ///< NaN where there is no point
  float down[kLanes];       ///< rows that it lies below the subpixel's own
  float code[kLanes];       ///< 0 ... 255, what the subpixel shows
  int32_t surface[kLanes];  ///< 0 ... 253 or kSky; others belong to nothing
  /// Of this point and the one three columns to the left, its neighbour in the same channel: -1 if
  /// they are seen through one lens, and if they belong together.
  int32_t chord[kLanes];
  int32_t linked[kLanes];
};

/// Sixteen values of a subpixel that was looked for under another lens.
struct alignas(64) Found {
  int32_t known[kLanes];  ///< -1 where the rest means something
  float x[kLanes];
  float z[kLanes];
  float code[kLanes];
  int32_t surface[kLanes];
  // What the lens sees at all: its place, its nearest point, the directions of its outermost ones.
  float lens_x[kLanes];
  float nearest_z[kLanes];
  float low_tan[kLanes];
  float high_tan[kLanes];
};

/// Rows 0 and 2 of the map from the scene to the panel: what makes x and z.
struct PanelMap {
  float x[3];
  float z[3];
};

/// lens = the integer nearest to offset + per_mm * glass_x.
struct alignas(64) LensMap {
  float offset[kLanes];
  float per_mm[kLanes];
};

struct Rules {
  bool occlusion;   ///< what is nearer wins
  float steepest;   ///< depth per width of a chord between two points of one surface
  float agreement;  ///< codes that two points of a chord, or two sides, may differ by
  float slot_tan;   ///< tangent between neighbouring subpixels of one channel
  float within;     ///< slots that a point may lie beside the ray, for nearest()
  bool one_side;    ///< what only one of two sides can see is taken
};

struct Kernel {
  /// Ray and lens of a column from a packet in Embree's layout.
  void (*place)(const PanelMap&, const LensMap&, const float* packet, Column&);
  /// Points of the lanes that Embree has followed; `surface` is not touched.
  void (*take_hits)(const PanelMap&, const float* packet, const int32_t* lanes, Column&);
  /// Sets chord and linked of a column that is complete.
  void (*join)(const Column& left, const Rules&, Column& column);
  /// Looks for the points of a target's rays on the chords under lens wanted[r]: columns
  /// first, first + 3, ... before end. The chord nearest to the eye wins; a chord between points
  /// that do not belong together says that nothing is known.
  void (*on_chords)(const Column* columns, int first, int end, const int32_t* wanted,
                    const Column& target, const Rules&, Found&);
  /// The same with single points: the one nearest to the eye among those that lie within
  /// rules.within slots, unless a chord of one surface runs before it. Without occlusion, the one
  /// nearest to the ray.
  void (*nearest)(const Column* columns, int first, int end, const int32_t* wanted,
                  const Column& target, const Rules&, Found&);
  /// The code at the same place under another lens: of the ray nearest in direction, within half
  /// a slot.
  void (*same_place)(const Column* columns, int first, int end, const int32_t* wanted,
                     const Column& target, const Rules&, Found&);
  /// Both sides: their mean, `part` of it from `other`, where they agree. What one side alone knows
  /// is taken if the other is there, cannot see that place, and sees nothing that is nearer by more
  /// than they lie apart: if it could see the place but does not, something hides it, and what it
  /// sees nearer may reach to where only the lens between them sees it.
  void (*merge)(const Found& other, const float* part, const Rules&, Found& into);
  /// Puts what is known into the lanes of `lanes` that are empty.
  void (*put)(const Found&, const int32_t* lanes, int32_t flag, Column&);
};

}  // namespace lenticule::render::reprojection

namespace lenticule::render {
LENTICULE_DECLARE_KERNEL(reprojection::Kernel, kReprojectionKernel)
}
