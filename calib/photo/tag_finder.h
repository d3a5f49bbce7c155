// SPDX-License-Identifier: Apache-2.0
// Finds the chart's tags in a photograph.
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "optics/vec.h"

struct apriltag_family;

namespace lenticule::calib {

/// Cells along a tag's side with its white rim, and the width of the rim.
inline constexpr int kTagCells = 10;
inline constexpr int kTagRimCells = 1;
/// Ids are 0 to kTagIds - 1.
inline constexpr int kTagIds = 587;

/// TagFamily owns the library's handle of the AprilTag family 36h11.
class TagFamily {
 public:
  TagFamily();
  ~TagFamily();
  TagFamily(const TagFamily&) = delete;
  TagFamily& operator=(const TagFamily&) = delete;

  [[nodiscard]] apriltag_family* get() const { return family_; }
  /// Returns kTagCells rows of kTagCells cells from the top, true = white. Requires an id of the
  /// family.
  [[nodiscard]] std::vector<bool> cells(int id) const;

 private:
  apriltag_family* family_;
};

/// PhotoLight is the light of a photograph, rows from the top.
struct PhotoLight {
  int width = 0;
  int height = 0;
  std::vector<float> light;  ///< mean of the channels
  /// Clipped part of the values that each pixel averages, in 255ths; empty: nothing was clipped.
  std::vector<uint8_t> clipped = {};
  std::vector<std::array<float, 3>> colours = {};  ///< red, green, blue; empty for grey pictures
};

struct TagSighting {
  int id = 0;
  /// Order of ChartTag::corners_px, picture pixels; (0, 0) is the corner of the first pixel.
  std::array<Vec2, 4> corners_px;
};

/// Returns all tags of the family, sorted by id, each once (the clearest sighting), with corners
/// that all edges of the tag determine (tag_alignment.h). If fewer than `wanted` are found, also
/// searches blurred copies of the picture. Light that is not finite counts as black.
///
/// Thread safety: any thread; starts no threads.
[[nodiscard]] std::vector<TagSighting> find_tags(const PhotoLight& picture, size_t wanted);

// Locates a tag that was found by all of its edges: the lenses make every edge coarse, so that the
// outline alone leaves its corners uncertain.

/// Moves the corners of a tag so that its cells, blurred, fit the picture best. `white` is
/// TagFamily::cells() of its id. Returns the tag unchanged if no fit is found near it, as for a tag
/// that is partly hidden.
///
/// Thread safety: any thread.
[[nodiscard]] TagSighting aligned(const PhotoLight& picture, const TagSighting& tag,
                                  const std::vector<bool>& white);

}  // namespace lenticule::calib
