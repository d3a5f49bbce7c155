// SPDX-License-Identifier: Apache-2.0
// Where method adaptive takes its samples: a few key pictures of the scene, each seen through the
// glass from a place on the viewing line, on every few rows and at every few pixels.
//
// All rays of a row lie in one plane with the viewing line, so that a point keeps its row in every
// key picture and only moves along it: (x, z) appears at x_glass = (x - e z / Z) / (1 - z / Z) to
// an eye at e, at x - e z where e is the tangent of parallel rays.
#pragma once

#include "base/interval.h"
#include "render/methods/adaptive/key_lookup_kernel.h"
#include "render/rays/glass_rays.h"
#include "render/row_sweep/row_planes.h"
#include "render/scene/stage.h"

namespace lenticule::render {

/// The samples of odd pictures lie half a step above and to the left of those of even ones.
struct KeySpacing {
  int row_step = 4;      ///< panel rows from one row of samples to the next
  double columns = 4.0;  ///< pixels from one column of samples to the next
  int pictures = 2;      ///< at least
};

/// Where the rays of a rig leave the glass, and to which places on the viewing line they go.
struct RayReach {
  Interval glass_mm;
  Interval eyes;  ///< mm; tangents of parallel rays
};
[[nodiscard]] RayReach reach_of(const RowPlanes& planes);

/// As many pictures as the viewing zone is wide. A dozen degrees apart, shading that depends on the
/// view changes little, and all else not at all; ten where scenes are `shiny`: what is mirrored or
/// seen through glass moves from one to the next, and a thin thing may show in neither.
[[nodiscard]] KeySpacing spacing_for(const RowPlanes& planes, const RayReach& reach, bool shiny);

/// Immutable, but for being replaced.
class KeyGrid {
 public:
  /// `planes` must outlive it. Rays of their rig see only what the pictures hold, but for what lies
  /// far off the glass at its left and right ends.
  KeyGrid(const RowPlanes& planes, const Stage& stage, const RayReach& reach,
          const KeySpacing& spacing);

  [[nodiscard]] int pictures() const { return lookup_.pictures; }
  [[nodiscard]] int columns() const { return lookup_.columns; }
  /// Places on the viewing line that the rig's rays go to, a good deal generous.
  [[nodiscard]] Interval eyes() const { return eyes_; }
  /// Elements from one picture's row to the next; a few more than there are columns.
  [[nodiscard]] int stride() const { return lookup_.stride; }
  [[nodiscard]] int rows() const { return rows_; }
  /// The rows of samples around a row of the panel, those of odd pictures too.
  struct Between {
    int above[2];
    float part[2];  ///< of the way to the next
  };
  [[nodiscard]] Between between(int panel_row) const;
  /// Elements of one row of samples in all pictures.
  [[nodiscard]] size_t row_samples() const {
    return static_cast<size_t>(pictures()) * static_cast<size_t>(stride());
  }
  [[nodiscard]] const lookup_kernel::Grid& lookup() const { return lookup_; }

  [[nodiscard]] PanelRay ray(int row, int picture, int column) const;
  /// The row of the panel that a sample lies in or next to.
  [[nodiscard]] int panel_row(int row, int picture) const;
  /// Of one rig: whether samples lie in the same places.
  [[nodiscard]] bool is_same(const KeyGrid& other) const;

 private:
  const RowPlanes* planes_;
  lookup_kernel::Grid lookup_{};
  int rows_ = 0;
  int row_step_ = 0;
  double height_px_ = 0.0;  ///< of subpixels in their row
  double x_first_ = 0.0, x_step_ = 0.0;
  double eye_first_ = 0.0, eye_step_ = 0.0;
  Interval eyes_{};
};

}  // namespace lenticule::render
