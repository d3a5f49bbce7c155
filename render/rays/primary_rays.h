// SPDX-License-Identifier: Apache-2.0
// PrimaryRays makes the rays of a tile's subpixels, one per subpixel and sample, in the scene
// frame.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <vector>

#include "base/interval.h"
#include "optics/model.h"
#include "optics/rig.h"
#include "optics/row_rays.h"
#include "render/accel/ray_stream.h"
#include "render/scene/scene.h"

namespace lenticule::render {

/// Returns the radical inverse of i in base 2: 0, 1/2, 1/4, 3/4, ...
[[nodiscard]] inline double radical_inverse(unsigned i) {
  double value = 0.0;
  for (double digit = 0.5; i != 0; i >>= 1, digit *= 0.5)
    if (i & 1U) value += digit;
  return value;
}

// Footprint of a subpixel: rays of samples inside its area and across its lens. Beam bounds a
// bundle of primary rays.

/// SubpixelPlace is a sample position. x and y are relative to the subpixel's centre, in fractions
/// of its width and height; `lens` is relative to the apex line of its lens, in fractions of the
/// lens pitch. Each lies in [-1/2, 1/2); x and lens increase to the right, y down.
struct SubpixelPlace {
  double x = 0.0;
  double y = 0.0;
  double lens = 0.0;
};

/// Returns a fixed stratified pattern (Hammersley points); a single sample is the centre.
[[nodiscard]] std::vector<SubpixelPlace> footprint_samples(int count);

/// PanelRay is the line of a ray: through (x_mm, y_mm, 0) in direction (tan_x, tan_y, 1).
struct PanelRay {
  double x_mm = 0.0;
  double y_mm = 0.0;
  double tan_x = 0.0;
  double tan_y = 0.0;
};

/// Footprint moves a subpixel's centre ray to another place of the same subpixel, under the same
/// lens.
class Footprint {
 public:
  Footprint(const optics::OpticalModel& model, SubpixelPlace place);

  /// Returns the ray through the displaced place. The lens point moves along the lens's apex line
  /// with the row; the remaining offset between panel point and lens point bends the ray by the
  /// sheet's refraction law. Slowly varying terms (the residual map, the exact law's vertical
  /// shift) are taken as constant across the subpixel, with an error below a hundredth of a
  /// subpixel. An eye sees the whole width of a lens in one colour: rays beside the apex line go to
  /// the point on the viewing line that the ray through the apex line goes to.
  [[nodiscard]] PanelRay displaced(const PanelRay& centre) const {
    return centred_ ? centre : moved(centre);
  }
  [[nodiscard]] bool centred() const { return centred_; }

 private:
  [[nodiscard]] PanelRay moved(const PanelRay& centre) const;
  [[nodiscard]] PanelRay through_apex(const PanelRay& centre) const;

  bool centred_;
  double lens_dx_mm_;  ///< displacement of the lens point
  double lens_dy_mm_;
  double shift_dx_mm_;  ///< displacement of the lens point minus that of the panel point
  double gap_mm_;
  double shape_;       ///< 1 - nu
  double tan_per_mm_;  ///< change of tan_x and tan_y per millimetre on the panel
  double across_lens_mm_;
};

[[nodiscard]] Interval operator*(Interval a, Interval b);

/// All rays (x + tan_x z, y + tan_y z, z), z < start_mm, with parameters in these intervals, in the
/// panel frame.
struct Beam {
  Interval x_mm, tan_x;
  Interval y_mm, tan_y;
  double start_mm = 0.0;

  void extend(const Beam& other);
};

/// Tile is a band of rows and a range of sheared columns. A column follows the slanted lens from
/// row to row, along one elemental image, so that its rays share lens and view.
struct Tile {
  int row_begin = 0;
  int rows = 0;
  int column_begin = 0;  ///< sheared: subpixel in the tile's first row
  int columns = 0;
};

/// Column range [begin, end) of a tile.
struct ColumnRange {
  int begin = 0;
  int end = 0;
};

/// BeamSize is the size of the part of a scene that one subpixel stands for: the distance to what
/// its neighbours show, in the panel frame. `z` is in millimetres before the panel.
struct BeamSize {
  double lens_mm = 0.0;            ///< width of a lens along a row
  double row_mm = 0.0;             ///< height of a row
  double subpixels_per_gap = 0.0;  ///< tangent of the angle between neighbouring views
  double inverse_distance = 0.0;   ///< 1 / distance of the viewing line

  /// Returns the distance between neighbouring lenses, or between neighbouring views where those
  /// are farther apart.
  [[nodiscard]] double across_mm(double z) const {
    return std::max(lens_mm * closer(z), subpixels_per_gap * std::abs(z));
  }
  [[nodiscard]] double along_mm(double z) const { return row_mm * closer(z); }

 private:
  [[nodiscard]] double closer(double z) const { return std::abs(1.0 - z * inverse_distance); }
};

class TilePlan {
 public:
  static constexpr int kRows = 16;      ///< one packet
  static constexpr int kColumns = 384;  ///< subpixels

  explicit TilePlan(const optics::Rig& rig);

  [[nodiscard]] int count() const { return bands_ * per_band_; }
  /// Returns the number of tiles in a band of kRows rows; tiles are numbered from left to right.
  [[nodiscard]] int per_band() const { return per_band_; }
  [[nodiscard]] Tile tile(int index) const;

  /// Returns the number of subpixels by which a column has moved to the left `row` rows below the
  /// tile's first row.
  [[nodiscard]] int shift(int row) const { return shifts_[static_cast<size_t>(row)]; }
  /// Returns the subpixel (3 i + channel) of a tile's column in one of its rows. It lies outside
  /// [0, row_subpixels()) if the shear leaves the panel.
  [[nodiscard]] int subpixel(const Tile& tile, int column, int row) const {
    return tile.column_begin + column - shift(row);
  }
  [[nodiscard]] int row_subpixels() const { return 3 * width_; }
  /// Returns the distance between two rows.
  [[nodiscard]] double row_mm() const { return beam_.row_mm; }
  [[nodiscard]] const BeamSize& beam() const { return beam_; }

 private:
  int width_;
  int height_;
  BeamSize beam_;
  std::array<int, kRows> shifts_{};
  int first_column_;
  int bands_;
  int per_band_;
};

/// Sets lane `lane` to the line `from`, starting at z = start_mm and going away from the viewer.
/// The ray parameter counts millimetres of z. The hit is reset to none.
inline void set_panel_ray(const Scene& scene, double start_mm, const PanelRay& from,
                          RayPacket& packet, size_t lane) {
  const Affine& to_scene = scene.scene_from_panel;
  const Vec3 origin{from.x_mm + start_mm * from.tan_x, from.y_mm + start_mm * from.tan_y, start_mm};
  set_lane(packet, lane, Vec3f(to_scene.point(origin)),
           Vec3f(to_scene.vector({-from.tan_x, -from.tan_y, -1.0})));
  packet.rays.hit.geomID[lane] = RTC_INVALID_GEOMETRY_ID;
}

/// Content nearer to the eye than this fraction of the viewing distance in front of the panel is
/// left out: all rays meet at the viewing line, where content has no size.
inline constexpr double kNearestContent = 0.99;

/// Returns the panel z where rays start: just before the scene's nearest surface, and at
/// most kNearestContent of the viewing distance.
[[nodiscard]] double primary_start_mm(double nearest_surface_mm, double viewing_distance_mm);

class PrimaryRays {
 public:
  /// Lifetime: `model` and `plan` must outlive the object.
  PrimaryRays(const optics::OpticalModel& model, const TilePlan& plan);

  /// Scratch memory of one thread.
  struct Workspace {
    struct Row {
      int begin = 0;  ///< subpixels of the row inside the tile: [begin, end)
      int end = 0;
      int first_evaluated = 0;  ///< subpixel of the first element of `rays`
      optics::RowRays rays;
    };
    std::array<Row, TilePlan::kRows> rows;
  };

  /// Fills `rays` packet by packet: sixteen rows of the tile's first column, then of its second,
  /// and so on. A ray's target is row * columns + column. Lanes outside the panel are inactive.
  void generate(const Scene& scene, const Tile& tile, const Footprint& footprint, double weight,
                Workspace& workspace, std::vector<PathRay>& rays) const;

  /// Returns the ray of one subpixel of a row as generate() makes it, without weight and target.
  [[nodiscard]] PathRay one(const Scene& scene, int row, int subpixel, const Footprint& footprint,
                            optics::RowRays& scratch) const;

  /// Returns primary_start_mm() for a scene.
  [[nodiscard]] double start_mm(const Scene& scene) const;

 private:
  [[nodiscard]] PathRay ray_of(const Scene& scene, const optics::RowRays& row, size_t k,
                               const Footprint& footprint, double start) const;
  void evaluate_rows(const Tile& tile, Workspace& workspace) const;

  const TilePlan& plan_;
  optics::RowRayEvaluator evaluator_;
  double distance_mm_;
};

}  // namespace lenticule::render
