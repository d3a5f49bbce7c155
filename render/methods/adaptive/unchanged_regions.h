// SPDX-License-Identifier: Apache-2.0
// UnchangedRegions finds the regions of the panel that look the same as in the previous frame: no
// changed object is visible through the region, casts a shadow there or changes the ambient light
// there.
#pragma once

#include <cstdint>
#include <vector>

#include "render/methods/adaptive/key_grid.h"
#include "render/options/render_options.h"
#include "render/scene/scene_objects.h"

namespace lenticule::render {

/// UnchangedRegions divides the panel into bands of rows and columns of some pixels. Thread safety:
/// immutable after construction.
class UnchangedRegions {
 public:
  static constexpr int kBandRows = 16;
  static constexpr int kColumnPixels = 32;

  /// Finds the unchanged regions for rays that go to `eyes` on the viewing line (mm; tangents for
  /// parallel rays). If the frames differ in more than individual objects, no region is unchanged.
  /// Regions that show view-dependent surfaces always count as changed, since reflections are not
  /// followed.
  UnchangedRegions(const RowPlanes& planes, const Interval& eyes, const Scene& scene,
                   const SoftLight& soft, const SceneObjects& before, const SceneObjects& now);

  [[nodiscard]] bool any() const { return kept_ > 0; }
  [[nodiscard]] bool whole_band(int band) const {
    return lost_in_band_[static_cast<size_t>(band)] == 0;
  }
  /// Returns true if a ray of the row that leaves the panel at x_mm is in an unchanged region.
  [[nodiscard]] bool at(int row, double x_mm) const;

 private:
  struct Patch {
    Interval x_mm, y_mm;
  };
  void mark_all_changed();
  bool mark_changes(const Scene& scene, const SoftLight& soft, const SceneObjects& before,
                    const SceneObjects& now);
  void mark_changed(const Bounds& box);
  void mark_changed(const Patch& patch);
  void mark_shadow_changed(const Bounds& box, const SceneLight& light, const SoftLight& soft,
                           const Bounds& within);
  [[nodiscard]] Patch seen_through(const Bounds& box) const;

  const RowPlanes& planes_;
  Interval eyes_;
  Affine panel_from_scene_;
  int bands_, columns_;
  double x_first_, columns_per_mm_;
  std::vector<Interval> band_y_mm_;
  std::vector<uint8_t> lost_;  ///< [band][column]; 1 = changed
  std::vector<int> lost_in_band_;
  size_t kept_ = 0;
};

}  // namespace lenticule::render
