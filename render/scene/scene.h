// SPDX-License-Identifier: Apache-2.0
// A scene committed to Embree: Embree's structures and everything that shading needs, in the scene
// frame.
//
// The scene frame is the world moved so that the stage's centre is the origin, turned so that its
// axes are the panel's, and scaled so that one unit is a millimetre on the panel. There single
// precision resolves a fraction of a subpixel however far from the world's origin the scene lies,
// and however large its units are.
#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "render/accel/embree.h"
#include "render/accel/quadrics.h"
#include "render/accel/wide_triangle.h"
#include "render/scene/scene_description.h"
#include "render/scene/scene_fingerprint.h"
#include "render/scene/stage.h"
#include "render/scene/surroundings.h"

namespace lenticule::render {

/// Lights that bring nothing to anything (render/commit/idle_lights.h): the picture is the same.
enum class IdleLights { LeaveOut, Keep };

/// Buffers that Embree reads in place.
struct MeshShape {
  std::vector<Vec3f> positions;  ///< one more than there are vertices: Embree reads 16 bytes each
  std::vector<std::array<uint32_t, 3>> triangles;
  std::vector<Vec3f> normals;             ///< per vertex, or empty
  std::vector<std::array<float, 2>> uvs;  ///< per vertex, or empty
  int material = 0;

  static constexpr uint32_t kNotWide = ~0U;
  /// By triangle: its number in Scene::wide_triangles, or kNotWide. Empty if none is wide.
  std::vector<uint32_t> wide;
  /// What Embree meets as triangles: the same, but wide ones are points. Empty if none is wide.
  std::vector<std::array<uint32_t, 3>> narrow_triangles;
};

/// A light in the scene frame.
struct SceneLight {
  Light::Kind kind = Light::Kind::Point;
  Vec3 position{};
  Vec3 direction{};  ///< unit, the way the light travels
  Vec3 colour{};
  bool falls_off = false;
  double cos_inner = 1.0;
  double cos_outer = 0.0;
};

/// Which list a geometry number of Embree's belongs to.
struct GeometryEntry {
  enum class Kind { Mesh, Spheres, Cones } kind = Kind::Mesh;
  size_t mesh = 0;
};

class PrimitiveTree;
class ShadingTables;
class ShaftProofs;

/// A scene committed to Embree: immutable while frames are rendered, shared by all threads.
struct Scene {
  /// Takes a description without nodes (see at_time()). `threads` build the acceleration
  /// structures, 0 = all cores; the picture does not depend on their number. Throws Error(Input)
  /// "source: object: cause" for numbers that are not finite, sizes that are not positive, indices
  /// out of range and surroundings that cannot be read; Error(Failed) for Embree's errors.
  Scene(const SceneDescription& description, const Stage& stage, const Surroundings& surroundings,
        int threads = 0, IdleLights idle_lights = IdleLights::LeaveOut);
  ~Scene();
  Scene(const Scene&) = delete;
  Scene& operator=(const Scene&) = delete;

  // Released last: the scene and its geometries belong to the device and read the shapes.
  EmbreeDevice device;
  std::vector<MeshShape> meshes;
  std::vector<SphereShape> spheres;
  std::vector<ConeShape> cones;
  std::vector<WideTriangle> wide_triangles;
  std::vector<GeometryEntry> geometries;  ///< by Embree's geometry number
  EmbreeScene embree;

  std::vector<Material> materials;
  std::vector<std::shared_ptr<const Texture>> textures;
  std::vector<SceneLight> lights;
  size_t lights_left_out = 0;  ///< which bring nothing to anything
  Vec3 ambient;
  Backdrop backdrop;
  bool colour_managed = true;

  Affine scene_from_panel;       ///< from millimetres in the panel frame; its origin is zero
  double units_per_world = 1.0;  ///< scene units per world unit
  double near_mm = 0.0;          ///< panel z of the nearest point to be shown
  Fingerprint content;           ///< scene_fingerprint()
  Fingerprint picture;           ///< picture_fingerprint()

  std::unique_ptr<const ShadingTables> shading;  ///< of all the above
  std::unique_ptr<const PrimitiveTree> tree;     ///< null if too large
  std::unique_ptr<ShaftProofs> proofs;  ///< grow while frames are rendered; null if too large

  /// Null for triangles that are not wide.
  [[nodiscard]] const WideTriangle* wide_triangle(const MeshShape& mesh, uint32_t triangle) const {
    if (mesh.wide.empty() || mesh.wide[triangle] == MeshShape::kNotWide) return nullptr;
    return &wide_triangles[mesh.wide[triangle]];
  }
};

/// In the scene frame, those of wide triangles in double precision.
[[nodiscard]] std::array<Vec3, 3> corners_of(const Scene& scene, const MeshShape& mesh,
                                             uint32_t triangle);

}  // namespace lenticule::render
