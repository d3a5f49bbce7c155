// SPDX-License-Identifier: Apache-2.0
// Inner loops of the methods that reuse points: they find points that were seen through one lens
// again through another. Compiled once per instruction set. Plain data only: this header must not
// bring shared inline functions into a file that is compiled for AVX-512.
//
// All rays of one row and channel lie in one plane. In this plane a ray is x = panel_x + tan z, in
// millimetres of the panel frame, with z toward the viewer.
#pragma once

#include <cstdint>

#include "base/cpu.h"

namespace lenticule::render::reprojection {

inline constexpr int kLanes = 16;    ///< rows of a tile
inline constexpr int kChannels = 3;  ///< columns between subpixels of one channel

/// State of a subpixel.
enum Flag : int32_t {
  kOutside,       ///< not on the panel, or its ray is not finite
  kEmpty,         ///< no content yet
  kProjected,     ///< a point of another micro-image or frame
  kInterpolated,  ///< mean of two neighbours, not a point of a surface
  kTraced,
};

/// Depth that stands for infinity: parallel within single precision.
inline constexpr float kSkyZ = -1e5F;
inline constexpr int32_t kSky = -1;  ///< surface number of the backdrop

/// Column holds the points and code values of one column of a tile: sixteen subpixels.
struct alignas(64) Column {
  float panel_x[kLanes];  ///< x of the subpixel's ray on the panel
  float tan[kLanes];
  int32_t lens[kLanes];
  int32_t flag[kLanes];     ///< Flag
  int32_t missing[kLanes];  ///< -1 if re-projection found no point
  float x[kLanes];          ///< exact position of the point
  float z[kLanes];          ///< NaN if there is no point
  float down[kLanes];       ///< rows between the point and the subpixel's own row, positive below
  float code[kLanes];       ///< displayed code value, 0 ... 255
  int32_t surface[kLanes];  ///< 0 ... 253 or kSky
  /// Relation to the point three columns to the left, the neighbour in the same channel. chord: -1
  /// if both are seen through one lens. linked: -1 if both belong together.
  int32_t chord[kLanes];
  int32_t linked[kLanes];
};

/// Found holds the results of a search for sixteen subpixels under another lens.
struct alignas(64) Found {
  int32_t known[kLanes];  ///< -1 in lanes whose results are valid
  float x[kLanes];
  float z[kLanes];
  float code[kLanes];
  int32_t surface[kLanes];
  // View of the lens as a whole: its position, its nearest point, its extreme directions.
  float lens_x[kLanes];
  float nearest_z[kLanes];
  float low_tan[kLanes];
  float high_tan[kLanes];
};

/// Rows 0 and 2 of the map from the scene to the panel, which give x and z; last, those of the
/// scene frame's origin.
struct PanelMap {
  float x[4];
  float z[4];
};

/// The lens number is the integer nearest to offset + per_mm * panel_x.
struct alignas(64) LensMap {
  float offset[kLanes];
  float per_mm[kLanes];
};

struct Rules {
  float steepest;   ///< largest depth per width of a chord between two points of one surface
  float agreement;  ///< largest difference in codes between points of a chord, or sides
  float slot_tan;   ///< tangent between neighbouring subpixels of one channel
  bool one_side;    ///< points that only one of the two sides can see are used
};

struct Kernel {
  /// Sets ray and lens of a column from a packet in Embree's layout.
  void (*place)(const PanelMap&, const LensMap&, const float* packet, Column&);
  /// Takes the hits of the lanes that Embree has traced; `surface` is not set.
  void (*take_hits)(const PanelMap&, const float* packet, const int32_t* lanes, Column&);
  /// Sets chord and linked of a complete column.
  void (*join)(const Column& left, const Rules&, Column& column);
  /// Intersects the target's rays with the chords under lens wanted[r], in columns first, first +
  /// 3, ... before end. The chord nearest to the eye wins; if its points do not belong together,
  /// the result is unknown.
  void (*on_chords)(const Column* columns, int first, int end, const int32_t* wanted,
                    const Column& target, const Rules&, Found&);
  /// Takes the code at the same place under another lens: that of the ray nearest in direction,
  /// within half a slot.
  void (*same_place)(const Column* columns, int first, int end, const int32_t* wanted,
                     const Column& target, const Rules&, Found&);
  /// Merges both sides. Where they agree, the result is their mean, with weight `part` for `other`.
  /// A result of one side alone is used if the other side exists, cannot see that place, and sees
  /// no point that is nearer by more than the distance between the two. If the other side could see
  /// the place but does not, the place is occluded; and a nearer point may extend to where only the
  /// lens between the two sides sees it.
  void (*merge)(const Found& other, const float* part, const Rules&, Found& into);
  /// Writes known results into the empty lanes among `lanes`.
  void (*put)(const Found&, const int32_t* lanes, int32_t flag, Column&);
};

}  // namespace lenticule::render::reprojection

namespace lenticule::render {
LENTICULE_DECLARE_KERNEL(reprojection::Kernel, kReprojectionKernel)
}
