// SPDX-License-Identifier: Apache-2.0
// TagFamily owns the library's handle of the AprilTag family 36h11.
#pragma once

#include <vector>

struct apriltag_family;

namespace lenticule::calib {

/// Cells along a tag's side with its white rim, and the width of the rim.
inline constexpr int kTagCells = 10;
inline constexpr int kTagRimCells = 1;
/// Ids are 0 to kTagIds - 1.
inline constexpr int kTagIds = 587;

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

}  // namespace lenticule::calib
