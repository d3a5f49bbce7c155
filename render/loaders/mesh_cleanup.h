// SPDX-License-Identifier: Apache-2.0
// Prepares meshes from files for tracing: repairs them, computes tangents where the file has none,
// and finds meshes so far from the origin that the single precision of their file shows.
#pragma once

#include <array>
#include <cmath>
#include <cstdint>
#include <span>
#include <vector>

#include "optics/vec.h"
#include "render/scene/scene_description.h"

namespace lenticule::render {

/// Returns twice the area times the unit normal of a closed polygon (Newell's sum), computed
/// relative to the first corner, so that polygons far from the origin keep precision.
[[nodiscard]] Vec3 polygon_area_vector(std::span<const Vec3> corners);

struct Triangulation {
  std::vector<std::array<uint32_t, 3>> triangles;  ///< indices of the corners, same orientation
  /// False if the outline crosses itself: then the triangles cover it only approximately.
  bool simple = true;
};

/// Triangulates by ear clipping in the polygon's own plane. A polygon with an area gives size - 2
/// triangles, minus one for each corner that is straight or coincides with its neighbour; a polygon
/// without area gives none. Repeated corners (a hole joined to the outline by a double edge) are
/// allowed. Takes linear time for convex polygons, otherwise at most the number of corners times
/// the number of concave corners.
[[nodiscard]] Triangulation triangulate(std::span<const Vec3> corners);

struct MeshRepairs {
  size_t dropped_triangles = 0;
  size_t recomputed_normals = 0;

  MeshRepairs& operator+=(const MeshRepairs& others);
  /// Adds notes about both to the scene.
  void write(SceneDescription& scene) const;
};

/// Drops triangles without area. Replaces zero or non-finite normals by the mean of the adjacent
/// faces' normals; normalizes all other normals. Positions must be finite, and indices in range.
MeshRepairs clean(TriangleMesh& mesh);

/// Sets the tangents from texture coordinates, `uvs` or `uvs2` of the mesh; does nothing if the
/// mesh lacks them. The bitangent cross(normal, tangent) * sign points to decreasing v, as normal
/// textures of glTF require. Vertices at which the texture is mirrored are split; a mesh without
/// normals gets the faces' normals, and so three vertices per triangle.
void compute_tangents(TriangleMesh& mesh, bool use_second_uvs);

/// Gives every triangle its own vertices, with all their attributes.
void split_vertices(TriangleMesh& mesh);

/// Texture coordinates beyond it count as 0.
inline constexpr double kFarthestUv = 1e6;

/// LostDigits notes meshes whose coordinates are coarse.
class LostDigits {
 public:
  /// Examines a mesh whose positions come from single precision, in the file's coordinates.
  void add(const TriangleMesh& mesh);
  /// Adds a note about the coarsest mesh, if any is coarse.
  void write(SceneDescription& scene) const;

 private:
  size_t meshes_ = 0;
  double coarsest_ = 0.0;  ///< step of the coordinates, in sizes of the mesh
  double step_ = 0.0;      ///< that step in units of the file
};

[[nodiscard]] inline bool is_unit(Vec3 v) { return std::abs(dot(v, v) - 1.0) < 1e-6; }
/// Returns what is wrong with a position, "not finite" or "too far away"; else null.
[[nodiscard]] const char* flaw_of(Vec3 position);
/// Returns zeros for coordinates so large that no texel can be told from its neighbours.
[[nodiscard]] std::array<float, 2> usable_uv(double u, double v);
/// Returns the light of an sRGB-encoded colour and its alpha; clips all to 0 ... 1, NaN to 0.
[[nodiscard]] std::array<float, 4> light_of(double red, double green, double blue, double alpha);

/// Light that surfaces reflect whose file states no colour.
inline constexpr float kPlainGrey = 0.6F;

/// Cleans the mesh of a file without materials and adds it to the scene: in its own colours, in
/// texture number `texture` unless that is negative, or grey. Notes repairs, and coordinates that
/// are coarse because the file has them in single precision. Throws the error of refuse_empty().
void add_only_mesh(TriangleMesh mesh, int texture, bool single_precision, SceneDescription& scene);

}  // namespace lenticule::render
