// SPDX-License-Identifier: Apache-2.0
// KeyGrid defines the sample positions of method adaptive: a few cache views of the scene, each
// seen through the panel from a place on the viewing line, with samples on every few rows and every
// few pixels.
//
// All rays of a row lie in one plane with the viewing line. So a point stays in its row in every
// cache view and moves only along the row: an eye at e sees (x, z) at x_panel = (x - e z / Z) / (1
// - z / Z); if rays are parallel with tangent e, at x - e z.
#pragma once

#include "base/interval.h"
#include "render/methods/adaptive/key_lookup_kernel.h"
#include "render/rays/panel_rays.h"
#include "render/row_sweep/row_planes.h"
#include "render/scene/stage.h"

namespace lenticule::render {

/// Spacing of the samples. The samples of odd views lie half a step above and to the left of those
/// of even views.
struct KeySpacing {
  int row_step = 4;      ///< panel rows from one row of samples to the next
  double columns = 4.0;  ///< pixels from one column of samples to the next
  int pictures = 2;      ///< number of cache views, at least 2
};

/// Ranges of a rig's rays on the panel and on the viewing line.
struct RayReach {
  Interval panel_mm;
  Interval eyes;  ///< mm; tangents for parallel rays
};
[[nodiscard]] RayReach reach_of(const RowPlanes& planes);

/// Chooses the number of cache views by the width of the viewing zone: one per 0.22 radians (a
/// dozen degrees), over which view-dependent shading changes little, and other shading not at all.
/// For `shiny` scenes one per 0.18 radians (ten degrees), since reflected and refracted content
/// moves between views, and a thin object may be visible in neither.
[[nodiscard]] KeySpacing spacing_for(const RowPlanes& planes, const RayReach& reach, bool shiny);

/// KeyGrid is immutable, except for assignment.
class KeyGrid {
 public:
  /// Lifetime: `planes` must outlive the object. The views contain everything that the rig's rays
  /// see, except content far from the panel at its left and right ends.
  KeyGrid(const RowPlanes& planes, const Stage& stage, const RayReach& reach,
          const KeySpacing& spacing);

  [[nodiscard]] int pictures() const { return lookup_.pictures; }
  [[nodiscard]] int columns() const { return lookup_.columns; }
  /// Returns the range of places on the viewing line to which the rig's rays go, with a generous
  /// margin.
  [[nodiscard]] Interval eyes() const { return eyes_; }
  /// Returns the number of elements from one view's row to the next; slightly more than columns().
  [[nodiscard]] int stride() const { return lookup_.stride; }
  [[nodiscard]] int rows() const { return rows_; }
  /// Between holds the two rows of samples around a panel row, for even and for odd views.
  struct Between {
    int above[2];
    float part[2];  ///< weight of the next row
  };
  [[nodiscard]] Between between(int panel_row) const;
  /// Returns the number of elements of one row of samples in all views.
  [[nodiscard]] size_t row_samples() const {
    return static_cast<size_t>(pictures()) * static_cast<size_t>(stride());
  }
  [[nodiscard]] const lookup_kernel::Grid& lookup() const { return lookup_; }

  [[nodiscard]] PanelRay ray(int row, int picture, int column) const;
  /// Returns the panel row that contains the sample or is nearest to it.
  [[nodiscard]] int panel_row(int row, int picture) const;
  /// Returns true if the samples of another grid of the same rig lie in the same places.
  [[nodiscard]] bool is_same(const KeyGrid& other) const;

 private:
  const RowPlanes* planes_;
  lookup_kernel::Grid lookup_{};
  int rows_ = 0;
  int row_step_ = 0;
  double height_px_ = 0.0;  ///< height of subpixels in their row
  double x_first_ = 0.0, x_step_ = 0.0;
  double eye_first_ = 0.0, eye_step_ = 0.0;
  Interval eyes_{};
};

}  // namespace lenticule::render
