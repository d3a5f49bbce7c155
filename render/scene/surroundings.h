// SPDX-License-Identifier: Apache-2.0
// What surrounds a scene: a flat colour, a sky gradient, an environment picture or the studio, our
// own light for models whose file has no lights (docs/render/shading.md states its formula); the
// ground plane; and the tone maps, which compress light into the range that a panel shows.
#pragma once

#include <memory>
#include <optional>
#include <string>

#include "optics/vec.h"
#include "render/scene/ground_shadow.h"
#include "render/scene/scene_description.h"
#include "render/scene/stage.h"

namespace lenticule::render {

enum class ToneMap {
  None,        ///< light above 1 is clipped
  PbrNeutral,  ///< of Khronos: keeps base colours, compresses highlights
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

/// Background of the studio, as shown: a light neutral grey.
inline constexpr Vec3 kStudioBackground{0.80, 0.80, 0.80};

/// Surroundings holds environment options that add to or replace the scene file's.
struct Surroundings {
  std::optional<Vec3> background{};  ///< replaces the scene's background
  bool sky = false;                  ///< vertical gradient instead of a flat background
  std::string environment_file{};    ///< latitude-longitude picture, empty = none
  bool ground = false;               ///< adds a plane under the scene
  Vec3 ground_colour{0.5, 0.5, 0.5};
  /// Scenes that the studio lights cast a shadow on the ground, unless `ground` is set.
  bool ground_shadow = true;
  /// Of scenes with metallic-roughness materials. Default: ToneMap::PbrNeutral in the light of the
  /// studio, otherwise none.
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
[[nodiscard]] TriangleMesh ground_plane(const Bounds& bounds, Vec3 up, int material);

}  // namespace lenticule::render
