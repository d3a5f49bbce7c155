// SPDX-License-Identifier: Apache-2.0
// GroundRow evaluates the shadow on the ground along rows of the panel.
#pragma once

#include <array>
#include <optional>

#include "render/row_sweep/row_planes.h"
#include "render/scene/scene.h"

namespace lenticule::render {

/// GroundRow computes once per row what its subpixels share. Thread safety: used by one thread.
/// Lifetime: the scene and the planes must outlive the object.
class GroundRow {
 public:
  /// The scene must have a ground shadow.
  GroundRow(const Scene& scene, const RowPlanes& planes);

  /// Begins a row whose rays go to `eyes` on the viewing line (mm; tangents of parallel rays).
  void start(const RowPlane& plane, const Interval& eyes);
  /// Returns the range on the panel of the rays that may cross the shadow; empty if none does.
  [[nodiscard]] const Interval& range_mm() const { return range_mm_; }
  /// Returns light_beyond() of a ray of the row.
  [[nodiscard]] double light(double x_mm, double tan_x, int channel) const;

 private:
  void set_range(const RowPlane& plane, const Interval& eyes);

  const Scene& scene_;
  const RowPlanes& planes_;
  std::array<Vec3, 4> corners_mm_;  ///< corners of the ground, in the panel frame
  std::optional<GroundShadow::Row> row_;
  Interval range_mm_;
};

}  // namespace lenticule::render
