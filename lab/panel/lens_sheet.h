// SPDX-License-Identifier: Apache-2.0
// The lens sheet as rays meet it: LensStack is one lens and the layers under it; SheetShape is the
// deformed grating of lenses and its position in space; true_view() is the ground truth of
// calibrations.
#pragma once

#include <cstdint>
#include <optional>
#include <vector>

#include "lab/panel/simulated_setup.h"
#include "optics/panel.h"
#include "optics/vec.h"

namespace lenticule::lab {

// Traces one ray through one cylinder lens and the layers under it. Coordinates of a lens: u across
// it from its apex line, v along the apex line, z toward the viewer with the apex at 0;
// millimetres.

struct LensStack {
  double pitch_mm = 0.0;  ///< width of a lens, across it
  double radius_mm = 0.0;
  double thickness_mm = 0.0;
  double index = 1.5;
  double gap_mm = 0.0;  ///< between the sheet and the pixels
  double gap_index = 1.0;
  bool lens_toward_panel = false;
  double valley = 0.0;  ///< fraction of the pitch, around the borders, through which no ray passes
};

/// Returns the direction behind a surface with unit `normal` (against the ray), from index n1 into
/// n2, with ratio = n1 / n2: vector form of Snell's law. Returns nothing on total reflection.
[[nodiscard]] std::optional<Vec3> refract(Vec3 direction, Vec3 normal, double ratio);

/// Returns the landing point of a ray from above on the plane of the pixels. `start` is the point
/// where the unrefracted ray would cross the plane z = 0, with |start.x| up to half a pitch (a
/// neighbour's surface is tried if the ray misses the lens); `direction` has length 1 and z < 0.
/// Returns nothing if no light passes.
[[nodiscard]] std::optional<Vec2> land(const LensStack& stack, Vec2 start, Vec3 direction);

/// ApertureRay is a ray to the lens surface at height `u`, v = 0, from a far point.
struct ApertureRay {
  Vec2 landing;
  double weight =
      0.0;  ///< weight of an equal step of u, proportional to its size as seen from the far point
};
/// Traces a ray from `eye`, in the coordinates of the lens, z > 0. Returns nothing if no light
/// passes.
[[nodiscard]] std::optional<ApertureRay> aperture_ray(const LensStack& stack, double u, Vec3 eye);

/// Returns the point of the plane z = 0 in the straight direction from `eye` whose light reaches
/// the apex at the origin: the origin itself, unless there is a slab above the apices.
[[nodiscard]] Vec2 straight_aim(const LensStack& stack, Vec3 eye);

// SheetShape is the form of a simulated sheet over the panel: the true position of each apex line,
// the local thickness of the stack, and the position in space of a curved panel.

/// SmoothField is a smooth random function on the square [-1, 1]^2, without constant and linear
/// part.
class SmoothField {
 public:
  struct Value {
    double value = 0.0;
    double slope_x = 0.0;
    double slope_y = 0.0;
  };
  SmoothField(double amplitude, uint64_t seed);
  [[nodiscard]] Value at(double x, double y) const;

 private:
  struct Wave {
    double x = 0.0;
    double y = 0.0;
    double phase = 0.0;
    double amplitude = 0.0;
  };
  [[nodiscard]] Value waves_at(double x, double y) const;
  void remove_plane_and_scale(double amplitude);

  std::vector<Wave> waves_;
  double constant_ = 0.0;
  double linear_x_ = 0.0;
  double linear_y_ = 0.0;
};

/// LocalLenses describes the lenses around one point of the apex surface.
struct LocalLenses {
  double coordinate = 0.0;  ///< lens coordinate of the point; apices are the integers
  Vec2 gradient;            ///< lenses per millimetre
  LensStack stack;          ///< stack for the requested colour of light

  [[nodiscard]] Vec2 across() const { return gradient * stack.pitch_mm; }  ///< length 1
};

/// Stance is the position and orientation of the apex surface at one of its points.
struct Stance {
  Vec3 point;
  Vec3 tangent{1, 0, 0};  ///< right; up is (0, 1, 0) everywhere
  Vec3 normal{0, 0, 1};

  [[nodiscard]] Vec3 local(Vec3 v) const { return {dot(v, tangent), v.y, dot(v, normal)}; }
};

/// SheetShape uses points in millimetres on the apex surface: x to the right along the surface, y
/// up.
class SheetShape {
 public:
  SheetShape(const optics::Panel& panel, const SimulatedSheet& sheet, double thermal_stretch = 0.0);

  [[nodiscard]] const SimulatedSheet& sheet() const { return sheet_; }
  [[nodiscard]] const optics::Panel& panel() const { return panel_; }
  [[nodiscard]] LocalLenses lenses_at(Vec2 point, int channel) const;
  [[nodiscard]] Stance stance_at(Vec2 point) const;
  /// Returns the point where a line in space, coming from the viewer's side, meets the apex
  /// surface.
  [[nodiscard]] std::optional<Vec2> meet(Vec3 from, Vec3 direction) const;
  [[nodiscard]] bool in_bubble(Vec2 point) const;

 private:
  struct Bubble {
    Vec2 centre;
    double radius = 0.0;
  };
  /// Returns the deformation at a point with coordinates from -1 to 1.
  [[nodiscard]] SmoothField::Value deformation_at(double x, double y) const;
  void scatter_bubbles();
  void mark_bubble(const Bubble& bubble);
  void scratch();
  void mark_cell(Vec2 point);

  optics::Panel panel_;
  SimulatedSheet sheet_;
  double half_width_mm_;
  double half_height_mm_;
  Vec2 gradient_;  // gradient of the perfect grating, lenses per millimetre
  SmoothField deformation_;
  int bubble_columns_ = 0;
  int bubble_rows_ = 0;
  std::vector<uint8_t> bubbly_;  // cells of a grid over the panel
};

/// TrueView describes how an eye sees a panel point in the middle of the light of a lens.
struct TrueView {
  double phase = 0.0;  ///< SimulatedBench::ground_truth_phase
  Vec3 aim;  ///< the point in the straight direction of the eye, on the level of the apices
};
/// Returns nothing if no light passes.
[[nodiscard]] std::optional<TrueView> true_view(const SheetShape& shape, Vec2 panel_point_mm,
                                                int channel, Vec3 eye, LightMiddle middle);
}  // namespace lenticule::lab
