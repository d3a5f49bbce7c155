// SPDX-License-Identifier: Apache-2.0
// SceneWriter collects a built-in scene as plain data: the elements of NFF, and textured meshes,
// which NFF cannot express.
#pragma once

#include <span>
#include <string>
#include <vector>

#include "scenes/elements.h"
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
  std::vector<Element> elements;
  std::vector<PicturedMesh> pictured;
  std::vector<std::string> comments;
  SceneCounts counts;  ///< total of both parts
};

/// Returns the scene as NFF text, without its textured meshes. Comments come after all other lines,
/// because some readers take a comment for the end of the file.
[[nodiscard]] std::string nff_text(const SceneParts& parts);

/// Pictures selects the output of textured surfaces.
enum class Pictures {
  Kept,   ///< separate meshes beside the elements
  Plain,  ///< elements in the mean colour of their picture
};

/// SceneWriter rounds the numbers of the elements as the text of NFF does, so that a scene and the
/// NFF file written from it give the same frames.
class SceneWriter {
 public:
  explicit SceneWriter(Pictures pictures) : pictures_(pictures) {}

  void view(const View& view);
  void background(Vec3 colour);
  void light(Vec3 position, Vec3 colour = {1, 1, 1});
  void fill(const Fill& fill);
  void sphere(Vec3 centre, double radius);
  /// Adds an open cone; a cylinder if both radii are equal.
  void cone(Vec3 base, double base_radius, Vec3 apex, double apex_radius);
  /// Adds a flat, convex polygon; some readers of NFF do not triangulate concave ones.
  void polygon(std::span<const Vec3> corners);
  void patch(std::span<const SurfacePoint> corners);
  /// Adds a textured mesh. Changes the fill of the following primitives.
  void pictured(PicturedMesh mesh);
  void comment(const std::string& text) { parts_.comments.push_back(text); }

  [[nodiscard]] SceneParts take() { return std::move(parts_); }

 private:
  void write_plain(const PicturedMesh& mesh);

  Pictures pictures_;
  SceneParts parts_;
  bool said_plain_ = false;
};

struct CheckerBoard {
  Vec3 corner;
  Vec3 along;   ///< edge that is divided into columns
  Vec3 across;  ///< edge that is divided into rows; the visible side is along x across
  int columns = 1;
  int rows = 1;
  Fill even;  ///< fill of the square at the corner
  Fill odd;
};

void write_checker_board(SceneWriter& out, const CheckerBoard& board);

}  // namespace lenticule::scenes
