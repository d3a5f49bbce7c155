// SPDX-License-Identifier: Apache-2.0
// The AprilTag family 36h11 as the library knows it; one owner for its C handles.
#pragma once

#include <vector>

struct apriltag_family;

namespace lenticule::calib {

/// Cells along a tag's side with its white rim, and without.
inline constexpr int kTagCells = 10;
inline constexpr int kTagRimCells = 1;
/// Ids are 0 to this number - 1.
inline constexpr int kTagIds = 587;

class TagFamily {
 public:
  TagFamily();
  ~TagFamily();
  TagFamily(const TagFamily&) = delete;
  TagFamily& operator=(const TagFamily&) = delete;

  [[nodiscard]] apriltag_family* get() const { return family_; }
  /// kTagCells rows of kTagCells cells from the top, true = white. Needs an id of the family.
  [[nodiscard]] std::vector<bool> cells(int id) const;

 private:
  apriltag_family* family_;
};

}  // namespace lenticule::calib
