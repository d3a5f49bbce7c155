// SPDX-License-Identifier: Apache-2.0
// What surrounds a scene: a flat colour, a sky gradient, an environment picture or the studio, our
// own light for models whose file has no lights (docs/render/shading.md states its formula); the
// ground plane; and the tone maps, which compress light into the range that a panel shows.
#pragma once

#include <array>
#include <cstddef>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "optics/vec.h"
#include "render/scene/scene_description.h"
#include "render/scene/stage.h"

namespace lenticule::render {

// GroundShadow is the soft shadow under a model that the studio lights. The ground is not an
// object: the shadow darkens the background where a ray that meets nothing crosses the ground from
// above. So bounds, depths and surfaces are those of the model alone. docs/render/shading.md states
// the formula, render/commit_scene.cpp computes it.

/// GroundGrid is a rectangle of points on the ground, in the scene frame.
struct GroundGrid {
  Vec3 up, across, along;     ///< unit, perpendicular
  double height = 0.0;        ///< dot product of up with the points of the ground
  double x = 0.0, y = 0.0;    ///< dot products of across and along with the first point
  double cell = 0.0;          ///< distance between points
  int columns = 0, rows = 0;  ///< points

  [[nodiscard]] Vec3 point(double column, double row) const {
    return up * height + across * (x + column * cell) + along * (y + row * cell);
  }
};

/// GroundShadow holds the darkness at the points of a grid. Thread safety: immutable.
class GroundShadow {
 public:
  /// Number of rays that are evaluated together.
  static constexpr size_t kRays = 16;
  /// Rays as Embree's packets hold them: arrays of kRays coordinates.
  struct Rays {
    const float *origin_x, *origin_y, *origin_z;
    const float *direction_x, *direction_y, *direction_z;
  };
  class Row;

  /// `darkness` is the share of the light that is missing, row by row, and zero at the border.
  GroundShadow(const GroundGrid& grid, std::vector<float> darkness);

  /// Returns the share of the background's light that a ray sees: less than 1 if its line crosses
  /// the shadow from above, also between the eye and the start of the ray.
  [[nodiscard]] double light_left(Vec3 origin, Vec3 direction) const;
  /// Computes the same for several rays; faster than one by one.
  void light_left(const Rays& rays, std::array<double, kRays>& out) const;
  /// Returns the corners of the grid, mapped.
  [[nodiscard]] std::array<Vec3, 4> corners(const Affine& map) const;

 private:
  /// Returns the share at a place on the grid, in cells from the first point.
  [[nodiscard]] double light_at(double column, double row) const;

  GroundGrid grid_;
  Vec3 column_axis_, row_axis_;      ///< across and along, per cell
  double first_column_, first_row_;  ///< coordinates of the grid's first point, in cells
  std::vector<float> darkness_;
};

/// GroundShadow::Row evaluates the lines (x + tan_x z, y + tan_y z, z) of a frame in which y and
/// tan_y are the same for all of them. Lifetime: must not outlive the shadow.
class GroundShadow::Row {
 public:
  Row(const GroundShadow& shadow, const Affine& shadow_from_frame, double y, double tan_y);

  /// Returns the share of the background's light that a line sees from above.
  [[nodiscard]] double light_left(double x, double tan_x) const;

 private:
  /// The value at x or tan_x is `first` + `slope` times it.
  struct Linear {
    double first = 0.0, slope = 0.0;
    [[nodiscard]] double at(double x) const { return first + slope * x; }
  };

  const GroundShadow& shadow_;
  Linear height_, column_, row_;           ///< coordinates of a line's point at z = 0, by x
  Linear falls_, column_step_, row_step_;  ///< components of its direction, by tan_x
};

enum class ToneMap {
  None,        ///< light above 1 is clipped
  PbrNeutral,  ///< Khronos' neutral map: keeps base colours, compresses highlights
  Aces,        ///< fit of the ACES reference transforms by Stephen Hill, as in three.js
};

/// Returns the tone map named none, pbr-neutral or aces. Throws Error(Usage) for other names.
[[nodiscard]] ToneMap tone_map_named(const std::string& name);

/// Maps linear light to linear light that the panel shows. All three channels of the result depend
/// on all three of `light`.
[[nodiscard]] Vec3 tone_mapped(ToneMap map, Vec3 light);

/// Flat ambient light of a scene that states none.
inline constexpr double kDefaultAmbient = 0.12;

/// Intensity of the default sun, which lights a scene with neither lights nor ambient light. Its
/// light comes from the upper left behind the viewer; kDefaultSunDirection is the direction in
/// which its light travels, along the panel's axes in the undistorted scene.
inline constexpr double kDefaultSun = 0.9;
inline constexpr Vec3 kDefaultSunDirection{0.4, -0.6, -1.0};

/// Returns the light from a direction of the studio, a grey room with soft boxes. x is to the right
/// of the viewer, y up, and z points to the viewer; `direction` is unit. A white matt surface that
/// faces the viewer appears with a light of 1.
[[nodiscard]] double studio_light(Vec3 direction);

/// Backgrounds of the studio, as shown: a light neutral grey, and a dark one for bright models.
inline constexpr Vec3 kStudioBackground{0.80, 0.80, 0.80};
inline constexpr Vec3 kDarkStudioBackground{0.12, 0.12, 0.12};

/// Returns the background of a scene that the studio lights, by the colours of its surfaces.
/// Returns nothing for other scenes, and for those whose file states a background.
[[nodiscard]] std::optional<Vec3> studio_background(const SceneDescription& scene);

/// Surroundings holds environment options that add to or replace the scene file's.
struct Surroundings {
  std::optional<Vec3> background{};  ///< replaces the scene's background
  bool sky = false;                  ///< vertical gradient instead of a flat background
  std::string environment_file{};    ///< latitude-longitude picture, empty = none
  bool ground = false;               ///< adds a plane under the scene
  Vec3 ground_colour{0.5, 0.5, 0.5};
  /// Scenes that the studio lights cast a shadow on the ground, unless `ground` is set.
  bool ground_shadow = true;
  /// Tone map of scenes with metallic-roughness materials. Default: ToneMap::PbrNeutral in the
  /// light of the studio, otherwise none.
  std::optional<ToneMap> tone_map{};
};

/// Backdrop is the light that comes from infinitely far away.
struct Backdrop {
  Vec3 colour;
  Vec3 up{0, 1, 0};      ///< unit, the world axis that is up
  Vec3 ahead{0, 0, -1};  ///< unit, the world direction at the centre of the environment picture
  bool sky = false;
  std::shared_ptr<const Texture> environment;
  /// Applied to the environment picture. Colours and the sky are stated as they are shown.
  ToneMap tone_map = ToneMap::None;
  /// Darkens the colour; null if there is none, as with a sky or a picture.
  std::shared_ptr<const GroundShadow> ground_shadow;

  /// Returns true if all rays see the same light.
  [[nodiscard]] bool flat() const { return !sky && !environment && !ground_shadow; }
};

/// Creates the backdrop. Throws Error(Input) for an environment file that cannot be read.
[[nodiscard]] Backdrop make_backdrop(const SceneDescription& description, const Stage& stage,
                                     const Surroundings& surroundings);

/// Sets the directions of the backdrop for another stage.
void turn_to(const Stage& stage, Backdrop& backdrop);

/// Returns the sky's colour in a direction whose cosine to the vertical is `up_cosine`.
[[nodiscard]] Vec3 sky_colour(double up_cosine);

/// Returns one colour channel of the light from `direction` (unit, away from the eye) as shown.
[[nodiscard]] double backdrop_light(const Backdrop& backdrop, Vec3 direction, int channel);

/// Returns one colour channel of the light, as shown, that a ray sees which meets nothing: that of
/// its direction, less the shadow on the ground. `direction` need not be unit.
[[nodiscard]] double light_beyond(const Backdrop& backdrop, Vec3 origin, Vec3 direction,
                                  int channel);

/// Returns the world axis nearest to the panel's up, so that "down" is preserved for files whose z
/// axis is up.
[[nodiscard]] Vec3 world_up(const Stage& stage);

/// Returns a large square under the scene's bounds, facing up, in world coordinates.
[[nodiscard]] TriangleMesh ground_plane(const Box& bounds, Vec3 up, int material);

}  // namespace lenticule::render
