// SPDX-License-Identifier: Apache-2.0
// SceneWriter writes a built-in scene: NFF text, plus content that NFF cannot express.
#pragma once

#include <string>
#include <vector>

#include "scenes/nff_writer.h"
#include "scenes/pictured_mesh.h"

namespace lenticule::scenes {

struct SceneCounts {
  int polygons = 0;  ///< flat polygons and patches
  int spheres = 0;
  int cones = 0;
  int lights = 0;

  [[nodiscard]] int primitives() const { return polygons + spheres + cones; }
};

/// SceneParts is a scene in two parts that belong together.
struct SceneParts {
  std::string nff;
  std::vector<PicturedMesh> pictured;
  SceneCounts counts;  ///< total of both parts
};

/// Pictures selects the output of textured surfaces.
enum class Pictures {
  Kept,   ///< separate meshes beside the NFF text
  Plain,  ///< primitives of the NFF text, in the mean colour of their picture
};

class SceneWriter {
 public:
  explicit SceneWriter(Pictures pictures) : pictures_(pictures) {}

  void view(const View& view) { text_.view(view); }
  void background(Vec3 colour) { text_.background(colour); }
  void light(Vec3 position, Vec3 colour = {1, 1, 1});
  void fill(const Fill& fill) { text_.fill(fill); }
  void sphere(Vec3 centre, double radius);
  /// Writes an open cone; a cylinder if both radii are equal.
  void cone(Vec3 base, double base_radius, Vec3 apex, double apex_radius);
  /// Writes a flat, convex polygon; some readers of NFF do not triangulate concave ones.
  void polygon(std::span<const Vec3> corners);
  void patch(std::span<const SurfacePoint> corners);
  /// Writes a textured mesh. Changes the fill of the following primitives.
  void pictured(PicturedMesh mesh);
  /// Adds a comment. Comments are written after all other lines, because some readers take a
  /// comment for the end of the file.
  void comment(const std::string& text) { comments_.push_back(text); }

  [[nodiscard]] SceneParts take();

 private:
  void write_plain(const PicturedMesh& mesh);

  Pictures pictures_;
  NffWriter text_;
  SceneParts parts_;
  std::vector<std::string> comments_;
  bool said_plain_ = false;
};

}  // namespace lenticule::scenes
