// SPDX-License-Identifier: Apache-2.0
// Scene holds a scene committed to Embree: Embree's structures and all shading data, in the scene
// frame.
//
// The scene frame has the world's axes. Its unit, the world's times a power of two, is 0.76 to 1.53
// millimetres on the panel, and its origin lies within half a metre of the panel's centre along
// each axis. In it single precision resolves a fraction of a subpixel, independent of the scene's
// units and of its distance from the world origin. The frame stays the same while the stage turns
// and while its place and scale change little, and so do the primitives and Embree's structures
// (SceneKeeper). render/commit_scene.cpp makes the scene.
#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <utility>
#include <vector>

#include "render/accel/embree.h"
#include "render/accel/primitives.h"
#include "render/scene/scene_description.h"
#include "render/scene/scene_fingerprint.h"
#include "render/scene/stage.h"
#include "render/scene/surroundings.h"

namespace lenticule::render {

/// IdleLights selects whether lights that cannot contribute to any surface are left out
/// (render/commit_scene.cpp). The picture is the same in both cases.
enum class IdleLights { LeaveOut, Keep };

/// MeshShape holds the buffers of one mesh. Embree reads the buffers in place.
struct MeshShape {
  std::vector<Vec3f> positions;  ///< one more than vertices: Embree reads 16 bytes each
  std::vector<std::array<uint32_t, 3>> triangles;
  std::vector<Vec3f> normals;             ///< per vertex, or empty
  std::vector<std::array<float, 2>> uvs;  ///< per vertex, or empty
  // For metallic-roughness materials, see TriangleMesh:
  std::vector<std::array<float, 2>> uvs2{};
  std::vector<std::array<float, 4>> colours{};
  std::vector<std::array<float, 4>> tangents{};
  int material = 0;

  static constexpr uint32_t kNotWide = ~0U;
  /// Index in Scene::wide_triangles per triangle, or kNotWide. Empty if the mesh has no
  /// wide triangle.
  std::vector<uint32_t> wide;
  /// The triangles as given to Embree: wide triangles are collapsed to points. Empty if the mesh
  /// has no wide triangle.
  std::vector<std::array<uint32_t, 3>> narrow_triangles;

  /// Returns the corners in single precision; see also corners_of().
  [[nodiscard]] std::array<Vec3f, 3> corners(size_t triangle) const {
    const auto& [a, b, c] = triangles[triangle];
    return {positions[a], positions[b], positions[c]};
  }
  /// Returns the positions without the last one, which is padding for Embree.
  [[nodiscard]] std::span<const Vec3f> vertices() const {
    return std::span(positions).first(positions.size() - 1);
  }
};
[[nodiscard]] inline Box box_of(const MeshShape& mesh) {
  Box box;
  for (const Vec3f& p : mesh.vertices()) box.extend(Vec3(p));
  return box;
}

/// A light in the scene frame; its node has no meaning.
using SceneLight = Light;

/// GeometryEntry maps an Embree geometry number to the list that holds the geometry.
struct GeometryEntry {
  enum class Kind { Mesh, Spheres, Cones } kind = Kind::Mesh;
  size_t mesh = 0;
};

/// SceneFrame is everything of a stage on which the primitives of a scene depend. Stages that
/// differ by a turn, or a little, have the same.
struct SceneFrame {
  double units_per_world = 1.0;    ///< power of two
  Vec3 origin{};                   ///< world point
  Vec3 up{};                       ///< world_up(): a ground plane faces it
  std::optional<Ground> ground{};  ///< Stage::ground, for the shadow
  friend bool operator==(const SceneFrame&, const SceneFrame&) = default;
};

class PbrScene;
class PrimitiveTree;
class ShadingTables;
class ShaftCache;

/// Scene holds a scene committed to Embree. Thread safety: shared by all threads; immutable while
/// frames are rendered, except `shaft_cache`.
struct Scene {
  /// Commits a description without nodes (see at_time()). `threads` is the number of threads that
  /// build the acceleration structures, 0 = all cores; the picture does not depend on it. Throws
  /// Error(Input) "source: object: cause" for non-finite numbers, non-positive sizes, indices out
  /// of range and an unreadable environment; Error(Failed) for Embree's errors.
  Scene(const SceneDescription& description, const Stage& stage, const Surroundings& surroundings,
        int threads = 0, IdleLights idle_lights = IdleLights::LeaveOut);
  ~Scene();
  Scene(const Scene&) = delete;
  Scene& operator=(const Scene&) = delete;

  /// Changes the stage; the description and the surroundings must be those of the constructor.
  /// Afterwards the scene equals a new one. Returns false, and changes nothing, if the stage has
  /// another SceneFrame. Throws Error(Input) for a stage without a usable size.
  [[nodiscard]] bool place(const SceneDescription& description, const Stage& stage,
                           const Surroundings& surroundings);

  // The device and the buffers come first, so that they are released last: the Embree scene and its
  // geometries belong to the device and read the buffers.
  EmbreeDevice device;
  std::vector<MeshShape> meshes;
  std::vector<SphereShape> spheres;
  std::vector<ConeShape> cones;
  std::vector<WideTriangle> wide_triangles;
  std::vector<GeometryEntry> geometries;  ///< indexed by Embree's geometry number
  EmbreeScene embree;

  std::vector<Material> materials;
  std::vector<std::shared_ptr<const Texture>> textures;
  std::vector<SceneLight> lights;
  size_t lights_left_out = 0;  ///< number of lights that cannot contribute to any surface
  Vec3 ambient;
  Backdrop backdrop;
  bool colour_managed = true;

  SceneFrame frame;
  Affine scene_from_panel;    ///< millimetres in the panel frame to scene frame
  double units_per_mm = 1.0;  ///< scene units in a millimetre along the panel's rows
  double near_mm = 0.0;       ///< panel z of the nearest point that may be displayed
  Fingerprint described;      ///< scene_fingerprint()
  Fingerprint content;        ///< fingerprint of `described` and of the light at the viewer
  Fingerprint picture;        ///< picture_fingerprint()

  std::unique_ptr<const ShadingTables> shading;  ///< shading tables of all members above
  /// Set if any material is metallic-roughness. Then all are: others are converted.
  std::unique_ptr<const PbrScene> pbr;
  std::unique_ptr<const PrimitiveTree> tree;  ///< null if too large
  std::unique_ptr<ShaftCache> shaft_cache;  ///< filled while frames are rendered; null if too large

  /// Returns null for a triangle that is not wide.
  [[nodiscard]] const WideTriangle* wide_triangle(const MeshShape& mesh, uint32_t triangle) const {
    if (mesh.wide.empty() || mesh.wide[triangle] == MeshShape::kNotWide) return nullptr;
    return &wide_triangles[mesh.wide[triangle]];
  }
};

/// SceneKeeper commits the scenes of a sequence of frames, and keeps from frame to frame what does
/// not change. Its scenes equal new ones. Thread safety: one thread.
class SceneKeeper {
 public:
  /// See Scene's constructor.
  SceneKeeper(Surroundings surroundings, int threads)
      : surroundings_(std::move(surroundings)), threads_(threads) {}

  /// Returns the committed scene, until the next call. A description that was passed before must
  /// not have changed, except for its cameras. Throws as Scene's constructor does.
  const Scene& commit(const std::shared_ptr<const SceneDescription>& description,
                      const Stage& stage);

 private:
  Surroundings surroundings_;
  int threads_;
  std::weak_ptr<const SceneDescription> description_;
  std::unique_ptr<Scene> scene_;
};

/// Returns the corners in the scene frame; in double precision for a wide triangle.
[[nodiscard]] std::array<Vec3, 3> corners_of(const Scene& scene, const MeshShape& mesh,
                                             uint32_t triangle);

}  // namespace lenticule::render
