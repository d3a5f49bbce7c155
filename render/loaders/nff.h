// SPDX-License-Identifier: Apache-2.0
// Reads the Neutral File Format: the line-based scene format of the classic ray-tracing test
// databases. NffScene makes a SceneDescription of its elements, for the reader of its text and for
// the built-in scenes.
#pragma once

#include <array>
#include <map>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "render/scene/scene_description.h"

namespace lenticule::render {

/// Reads every kind of line: v, b, l, f, s, c, p, pp and '#'. Throws Error(Input) "source:line:
/// reason" for the first error. Takes time linear in the text, except for concave polygons (see
/// triangulate).
[[nodiscard]] SceneDescription parse_nff(std::string_view text, const std::string& source);

/// NffScene takes finite numbers within the limits of render/loaders/formats.h, and repairs or
/// drops primitives without effect on the picture; finish() adds notes about them.
class NffScene {
 public:
  explicit NffScene(const std::string& source) {
    scene_.source = source;
    scene_.colour_managed = false;
  }

  /// Sets the camera; its direction must be usable.
  void view(const Camera& camera) { scene_.cameras.push_back(camera); }
  [[nodiscard]] bool has_view() const { return !scene_.cameras.empty(); }
  void background(Vec3 colour) { scene_.background = colour; }
  void light(Vec3 position, Vec3 colour) {
    scene_.lights.push_back({.kind = Light::Kind::Point, .position = position, .colour = colour});
  }
  [[nodiscard]] size_t lights() const { return scene_.lights.size(); }
  /// Sets the material of the following surfaces: colour, Kd, Ks, shine, T and index of refraction.
  void fill(Material material);
  /// Adds a sphere; a negative radius makes the inside visible.
  void sphere(Vec3 centre, double radius);
  /// Adds an open cone; negative radii make the inside visible, and both must have the same sign.
  void cone(Vec3 base, double base_radius, Vec3 apex, double apex_radius);
  /// Adds a polygon of at least three corners; `normals` are per corner, or empty. Returns false if
  /// one material would have more than kMaxVertices corners.
  [[nodiscard]] bool polygon(std::span<const Vec3> corners, std::span<const Vec3> normals);
  void note(const std::string& text) { scene_.notes.push_back(text); }

  /// Returns the scene. Throws Error(Input) if it has no surface.
  [[nodiscard]] SceneDescription finish();

 private:
  using MaterialKey = std::array<double, 8>;
  /// Numbers of primitives that were dropped or repaired.
  struct Dropped {
    int flat_polygons = 0;
    int empty_spheres = 0;
    int empty_cones = 0;
    int crossed_polygons = 0;
    int repaired_normals = 0;
    bool material_missing = false;
  };

  int material_index(const Material& m);
  int material();
  TriangleMesh& mesh(bool smooth);
  void append_normals(TriangleMesh& mesh, std::span<const Vec3> corners,
                      std::span<const Vec3> normals);
  void finish_lights();

  SceneDescription scene_;
  Dropped dropped_;
  int current_material_ = -1;
  std::map<MaterialKey, size_t> materials_;
  std::vector<std::array<int, 2>> mesh_of_;  ///< per material: its polygon and its patch mesh
};

}  // namespace lenticule::render
