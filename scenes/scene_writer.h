// SPDX-License-Identifier: Apache-2.0
// SceneWriter collects a built-in scene as plain data: the elements of NFF, and textured meshes,
// which NFF cannot express.
#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "optics/vec.h"
#include "scenes/elements.h"

namespace lenticule::scenes {

// PicturedMesh is a textured triangle mesh; with functions for the few shapes that built-in scenes
// use.

/// Picture holds colours as code values from 0 to 1, as in NFF.
struct Picture {
  std::string name;
  int width = 0;
  int height = 0;
  std::vector<float> rgb;  ///< width * height * 3, rows from the top

  /// Returns the mean colour, which is the picture's colour from far away.
  [[nodiscard]] Vec3 mean() const;
};
using SharedPicture = std::shared_ptr<const Picture>;

// Each picture is computed once. All except the painting repeat seamlessly. Thread safety: safe
// from any thread.

/// Returns two by two squares, pale and dark.
[[nodiscard]] SharedPicture checker_picture();
/// Returns white stone with dark veins.
[[nodiscard]] SharedPicture marble_picture();
/// Returns four floor boards, one above the other, with grain along u.
[[nodiscard]] SharedPicture wood_picture();
/// Returns eight courses of red bricks in mortar, each shifted by half a brick.
[[nodiscard]] SharedPicture brick_picture();
/// Returns rows of diamonds, for a rug.
[[nodiscard]] SharedPicture weave_picture();
/// Returns a landscape: hills, a lake and a low sun.
[[nodiscard]] SharedPicture painting_picture();

struct PicturedMesh {
  Fill fill{};  ///< the fill's colour multiplies the picture
  SharedPicture picture{};
  std::vector<Vec3> positions{};
  std::vector<Vec3> normals{};              ///< per position, unit; empty for flat shading
  std::vector<std::array<float, 2>> uvs{};  ///< per position; v = 0 at the picture's top
  std::vector<std::array<uint32_t, 3>> triangles{};
};

/// PicturedBoard is a parallelogram that repeats its picture `columns` times along and `rows` times
/// across. The picture's top left is at `corner`; `along` is its top edge, `across` its left edge.
struct PicturedBoard {
  Vec3 corner;
  Vec3 along;
  Vec3 across;
  double columns = 1.0;
  double rows = 1.0;
};
void append_board(PicturedMesh& mesh, const PicturedBoard& board);

/// Appends the six sides of a box with edges along the axes; each side repeats the picture once per
/// `unit`.
void append_box(PicturedMesh& mesh, Vec3 low, Vec3 high, double unit);

/// Appends a ball with its poles along z, with `cuts` divisions from pole to pole and twice as many
/// around: 4 cuts (cuts - 1) triangles with the ball's normals. The picture covers the ball once.
void append_ball(PicturedMesh& mesh, Vec3 centre, double radius, int cuts);

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

  void view(const View& view) { add(view); }
  void background(Vec3 colour) { add(Background{colour}); }
  void light(Vec3 position, Vec3 colour = {1, 1, 1}) { add(PointLight{position, colour}); }
  void fill(const Fill& fill) { add(fill); }
  void sphere(Vec3 centre, double radius) { add(Sphere{centre, radius}); }
  /// Adds an open cone; a cylinder if both radii are equal.
  void cone(Vec3 base, double base_radius, Vec3 apex, double apex_radius) {
    add(Cone{base, base_radius, apex, apex_radius});
  }
  /// Adds a flat, convex polygon; some readers of NFF do not triangulate concave ones.
  void polygon(std::span<const Vec3> corners) { add(Polygon{{corners.begin(), corners.end()}}); }
  void patch(std::span<const SurfacePoint> corners);
  /// Adds a textured mesh. Changes the fill of the following primitives.
  void pictured(PicturedMesh mesh);
  void comment(const std::string& text) { parts_.comments.push_back(text); }

  [[nodiscard]] SceneParts take() { return std::move(parts_); }

 private:
  void add(Element element);
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

class NffWriter {
 public:
  /// Writes each line of `text` as a comment line.
  void comment(std::string_view text);
  void add(const Element& element);

  [[nodiscard]] std::string take() { return std::move(text_); }

 private:
  std::string text_;
};

/// Returns the number that a reader of the text gets for a number: with nine significant digits,
/// which exceeds single precision, and without a negative zero.
[[nodiscard]] double as_read_from_nff(double number);

}  // namespace lenticule::scenes
