// SPDX-License-Identifier: Apache-2.0
// What a built-in scene is written into: NFF text, and beside it what NFF cannot say.
#pragma once

#include <string>
#include <vector>

#include "scenes/nff_writer.h"
#include "scenes/pictured_mesh.h"

namespace lenticule::scenes {

struct SceneCounts {
  int polygons = 0;  ///< flat ones and patches
  int spheres = 0;
  int cones = 0;
  int lights = 0;

  [[nodiscard]] int primitives() const { return polygons + spheres + cones; }
};

/// A scene in two parts that are shown together.
struct SceneParts {
  std::string nff;
  std::vector<PicturedMesh> pictured;
  SceneCounts counts;  ///< of both
};

/// What becomes of surfaces that wear a picture.
enum class Pictures {
  Kept,   ///< they are handed out beside the NFF text
  Plain,  ///< they are in the text, in the mean colour of their picture
};

class SceneWriter {
 public:
  explicit SceneWriter(Pictures pictures) : pictures_(pictures) {}

  void view(const View& view) { text_.view(view); }
  void background(Vec3 colour) { text_.background(colour); }
  void light(Vec3 position, Vec3 colour = {1, 1, 1});
  void fill(const Fill& fill) { text_.fill(fill); }
  void sphere(Vec3 centre, double radius);
  /// Open; a cylinder where both radii are equal.
  void cone(Vec3 base, double base_radius, Vec3 apex, double apex_radius);
  /// Flat and convex: not every reader of NFF cuts concave ones.
  void polygon(std::span<const Vec3> corners);
  void patch(std::span<const SurfacePoint> corners);
  /// Changes the fill of what follows.
  void pictured(PicturedMesh mesh);
  /// Comments are gathered and written after everything else, because readers are in use that take
  /// one for the end of the file.
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
