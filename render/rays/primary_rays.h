// SPDX-License-Identifier: Apache-2.0
// PrimaryRays makes the rays of a tile's subpixels, one per subpixel and sample, in the scene
// frame.
#pragma once

#include <array>
#include <vector>

#include "optics/row_rays.h"
#include "render/accel/ray_stream.h"
#include "render/rays/footprint.h"
#include "render/rays/tile.h"
#include "render/scene/scene.h"

namespace lenticule::render {

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
