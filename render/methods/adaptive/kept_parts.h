// SPDX-License-Identifier: Apache-2.0
// Parts of the glass through which nothing looks different than in the frame before, because
// nothing that changed is seen through them, throws a shadow there or takes ambient light away.
#pragma once

#include <cstdint>
#include <vector>

#include "render/methods/adaptive/key_grid.h"
#include "render/options/soft_light.h"
#include "render/scene/scene_things.h"

namespace lenticule::render {

/// Immutable after construction. The glass is cut into bands of rows and columns of some pixels.
class KeptParts {
 public:
  static constexpr int kBandRows = 16;
  static constexpr int kColumnPixels = 32;

  /// Of what rays see that go to `eyes` on the viewing line (mm; tangents of parallel rays). All is
  /// lost where frames differ in more than things, and through what depends on the view, since what
  /// is mirrored there is not followed.
  KeptParts(const RowPlanes& planes, const Interval& eyes, const Scene& scene,
            const SoftLight& soft, const SceneThings& before, const SceneThings& now);

  [[nodiscard]] bool any() const { return kept_ > 0; }
  [[nodiscard]] bool whole_band(int band) const {
    return lost_in_band_[static_cast<size_t>(band)] == 0;
  }
  /// Where a ray of a row leaves the glass.
  [[nodiscard]] bool at(int row, double x_mm) const;

 private:
  struct Patch {
    Interval x_mm, y_mm;
  };
  void lose_all();
  bool lose_changes(const Scene& scene, const SoftLight& soft, const SceneThings& before,
                    const SceneThings& now);
  void lose(const Bounds& box);
  void lose(const Patch& patch);
  void lose_shadow(const Bounds& box, const SceneLight& light, const SoftLight& soft,
                   const Bounds& within);
  [[nodiscard]] Patch seen_through(const Bounds& box) const;

  const RowPlanes& planes_;
  Interval eyes_;
  Affine panel_from_scene_;
  int bands_, columns_;
  double x_first_, columns_per_mm_;
  std::vector<Interval> band_y_mm_;
  std::vector<uint8_t> lost_;  ///< [band][column]
  std::vector<int> lost_in_band_;
  size_t kept_ = 0;
};

}  // namespace lenticule::render
