// SPDX-License-Identifier: Apache-2.0
// SceneWriter collects a built-in scene as plain data: the elements of NFF, and textured meshes,
// which NFF cannot express.
#pragma once

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <cstdint>
#include <initializer_list>
#include <iterator>
#include <memory>
#include <numbers>
#include <span>
#include <string>
#include <string_view>
#include <type_traits>
#include <utility>
#include <variant>
#include <vector>

#include "optics/vec.h"
#include "scenes/elements.h"

namespace lenticule::scenes {

/// Picture holds colours as code values from 0 to 1, as in NFF.
struct Picture {
  std::string name;
  int width = 0;
  int height = 0;
  std::vector<float> rgb;  ///< width * height * 3, rows from the top

  /// Returns the mean colour, which is the picture's colour from far away.
  [[nodiscard]] Vec3 mean() const {
    Vec3 sum;
    for (size_t i = 0; i + 2 < rgb.size(); i += 3) sum += Vec3{rgb[i], rgb[i + 1], rgb[i + 2]};
    return sum / std::max(1.0, static_cast<double>(rgb.size() / 3));
  }
};

using SharedPicture = std::shared_ptr<const Picture>;

/// Makes a picture from colour(u, v) at the centre of each texel; u points right and v down, both
/// in (0, 1).
SharedPicture paint(const char* name, int width, int height, auto colour) {
  Picture picture{.name = name, .width = width, .height = height, .rgb = {}};
  picture.rgb.reserve(static_cast<size_t>(width) * static_cast<size_t>(height) * 3);
  for (int row = 0; row < height; ++row)
    for (int column = 0; column < width; ++column) {
      const Vec3 c = colour((column + 0.5) / width, (row + 0.5) / height);
      for (const double value : {c.x, c.y, c.z})
        picture.rgb.push_back(static_cast<float>(std::clamp(value, 0.0, 1.0)));
    }
  return std::make_shared<const Picture>(std::move(picture));
}

inline Vec3 checker_colour(double u, double v) {
  return (u < 0.5) == (v < 0.5) ? Vec3{0.90, 0.88, 0.82} : Vec3{0.16, 0.18, 0.22};
}

// Each picture is computed once. All except the painting repeat seamlessly. Thread safety: safe
// from any thread.

/// Returns two by two squares, pale and dark.
[[nodiscard]] inline SharedPicture checker_picture() {
  // Texels are interpolated over one texel's width, so sharp edges need many texels.
  static const SharedPicture picture = paint("checker", 64, 64, checker_colour);
  return picture;
}

inline constexpr double kTurn = 2.0 * std::numbers::pi;

inline Vec3 blend(Vec3 from, Vec3 to, double share) {
  return from + (to - from) * std::clamp(share, 0.0, 1.0);
}

/// Returns 0 below `low`, 1 above `high`, with a smooth transition between.
inline double smooth_step(double low, double high, double x) {
  const double t = std::clamp((x - low) / (high - low), 0.0, 1.0);
  return t * t * (3.0 - 2.0 * t);
}

/// Returns a pseudo-random value from 0 to 1, the same on every machine.
inline double random_value(int x, int y) {
  uint32_t h = static_cast<uint32_t>(x) * 0x9e3779b1U ^ static_cast<uint32_t>(y) * 0x85ebca77U;
  h = (h ^ (h >> 15)) * 0x2c1b3c6dU;
  h = (h ^ (h >> 12)) * 0x297a2d39U;
  return (h ^ (h >> 15)) / 4294967296.0;
}

/// Interpolates random values on a grid of columns x rows over the unit square; repeats outside it.
inline double noise(double u, double v, int columns, int rows) {
  const double x = u * columns;
  const double y = v * rows;
  const int i = static_cast<int>(std::floor(x));
  const int j = static_cast<int>(std::floor(y));
  const auto wrap = [](int k, int n) { return ((k % n) + n) % n; };
  const auto at = [&](int di, int dj) {
    return random_value(wrap(i + di, columns) + 131 * columns, wrap(j + dj, rows) + 17 * rows);
  };
  const double s = smooth_step(0.0, 1.0, x - i);
  const double t = smooth_step(0.0, 1.0, y - j);
  return std::lerp(std::lerp(at(0, 0), at(1, 0), s), std::lerp(at(0, 1), at(1, 1), s), t);
}

/// Sums noise octaves of increasing detail, each with half the weight of the previous; about 0 to
/// 1.
inline double turbulence(double u, double v, int columns, int rows) {
  double sum = 0.0;
  double weight = 0.5;
  for (int octave = 0; octave < 5; ++octave) {
    sum += weight * noise(u, v, columns << octave, rows << octave);
    weight /= 2.0;
  }
  return sum;
}

inline Vec3 marble_colour(double u, double v) {
  const double bend = turbulence(u, v, 4, 4);
  const double vein = std::abs(std::sin(kTurn * (u + v + 1.6 * bend)));
  const Vec3 stone = blend({0.80, 0.79, 0.77}, {0.96, 0.95, 0.93}, turbulence(u, v, 3, 5));
  return blend({0.30, 0.31, 0.36}, stone, std::pow(vein, 0.35));
}

/// Returns white stone with dark veins.
[[nodiscard]] inline SharedPicture marble_picture() {
  static const SharedPicture picture = paint("marble", 256, 256, marble_colour);
  return picture;
}

inline Vec3 wood_colour(double u, double v) {
  constexpr int kBoards = 4;
  const int board = std::min(kBoards - 1, static_cast<int>(v * kBoards));
  const double across = v * kBoards - board;
  const double along = u + 0.37 * board;  // different offsets, so that no two boards look alike
  const double grain = turbulence(along, v, 2, 32);
  const double rings = 0.5 + 0.5 * std::sin(kTurn * (5.0 * across + 3.0 * grain));
  Vec3 colour = blend({0.42, 0.25, 0.12}, {0.66, 0.44, 0.24}, 0.35 * rings + 0.65 * grain);
  colour = colour * (0.85 + 0.3 * random_value(board, 7));
  const double gap = std::min(across, 1.0 - across);
  return blend({0.12, 0.07, 0.04}, colour, smooth_step(0.0, 0.035, gap));
}

/// Returns four floor boards, one above the other, with grain along u.
[[nodiscard]] inline SharedPicture wood_picture() {
  static const SharedPicture picture = paint("wood", 256, 256, wood_colour);
  return picture;
}

inline Vec3 brick_colour(double u, double v) {
  constexpr int kCourses = 8;
  constexpr int kBricks = 4;
  const int course = std::min(kCourses - 1, static_cast<int>(v * kCourses));
  const double x = u * kBricks + (course % 2 == 0 ? 0.0 : 0.5);
  const int brick = static_cast<int>(x) % kBricks;
  const double joint_u = std::min(x - std::floor(x), std::ceil(x) - x) * 2.0;
  const double in_course = v * kCourses - course;
  const double joint = std::min(joint_u, std::min(in_course, 1.0 - in_course));
  const double rough = turbulence(u, v, 16, 16);
  const Vec3 clay = blend({0.50, 0.20, 0.13}, {0.72, 0.36, 0.24},
                          0.5 * rough + 0.5 * random_value(brick, course));
  return blend({0.70, 0.68, 0.63}, clay, smooth_step(0.05, 0.09, joint));
}

/// Returns eight courses of red bricks in mortar, each shifted by half a brick.
[[nodiscard]] inline SharedPicture brick_picture() {
  static const SharedPicture picture = paint("bricks", 256, 256, brick_colour);
  return picture;
}

inline Vec3 weave_colour(double u, double v) {
  const double x = std::abs(u * 4.0 - std::floor(u * 4.0) - 0.5);
  const double y = std::abs(v * 4.0 - std::floor(v * 4.0) - 0.5);
  const double ring = x + y;  // diamonds: lines of equal |x| + |y|
  const double thread = 0.92 + 0.08 * std::sin(kTurn * 64.0 * u) * std::sin(kTurn * 64.0 * v);
  if (ring < 0.12) return Vec3{0.86, 0.72, 0.36} * thread;
  if (ring < 0.25) return Vec3{0.16, 0.22, 0.42} * thread;
  if (ring < 0.33) return Vec3{0.88, 0.84, 0.74} * thread;
  return Vec3{0.56, 0.12, 0.14} * thread;
}

/// Returns rows of diamonds, for a rug.
[[nodiscard]] inline SharedPicture weave_picture() {
  static const SharedPicture picture = paint("weave", 256, 256, weave_colour);
  return picture;
}

inline Vec3 painting_colour(double u, double v) {
  constexpr double kShore = 0.66;
  const bool mirrored = v > kShore;  // the lake reflects the sky
  const double height = mirrored ? 2.0 * kShore - v : v;
  Vec3 colour = blend({0.24, 0.34, 0.62}, {0.98, 0.74, 0.42}, height / kShore);
  const double sun = std::hypot((u - 0.68) * 1.5, height - 0.42);
  colour = blend({1.0, 0.95, 0.75}, colour, smooth_step(0.06, 0.075, sun));
  constexpr std::array<Vec3, 3> kHills = {Vec3{0.46, 0.42, 0.58}, Vec3{0.26, 0.32, 0.36},
                                          Vec3{0.12, 0.22, 0.16}};
  for (size_t k = 0; k < kHills.size(); ++k) {
    const double n = static_cast<double>(k);
    const double ridge = 0.46 + 0.07 * n + 0.06 * std::sin(5.0 * u * (1.0 + 0.7 * n) + 2.1 * n) +
                         0.05 * turbulence(u, 0.2 * n, 6, 6);
    if (height > ridge) colour = kHills[k];
  }
  return mirrored ? blend(colour, {0.10, 0.16, 0.24}, 0.35) : colour;
}

/// Returns a landscape: hills, a lake and a low sun.
[[nodiscard]] inline SharedPicture painting_picture() {
  static const SharedPicture picture = paint("painting", 320, 240, painting_colour);
  return picture;
}

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

inline uint32_t append_point(PicturedMesh& mesh, Vec3 position, double u, double v) {
  mesh.positions.push_back(position);
  mesh.uvs.push_back({static_cast<float>(u), static_cast<float>(v)});
  return static_cast<uint32_t>(mesh.positions.size() - 1);
}

inline void append_board(PicturedMesh& mesh, const PicturedBoard& board) {
  const auto& [corner, along, across, columns, rows] = board;
  const uint32_t a = append_point(mesh, corner, 0, 0);
  const uint32_t b = append_point(mesh, corner + across, 0, rows);
  const uint32_t c = append_point(mesh, corner + along + across, columns, rows);
  const uint32_t d = append_point(mesh, corner + along, columns, 0);
  mesh.triangles.push_back({a, b, c});
  mesh.triangles.push_back({a, c, d});
}

/// Appends the six sides of a box with edges along the axes; each side repeats the picture once per
/// `unit`.
inline void append_box(PicturedMesh& mesh, Vec3 low, Vec3 high, double unit) {
  const Vec3 size = high - low;
  const Vec3 x{size.x, 0, 0};
  const Vec3 y{0, size.y, 0};
  const Vec3 z{0, 0, size.z};
  const auto side = [&](Vec3 corner, Vec3 along, Vec3 across) {
    append_board(mesh, {.corner = corner,
                        .along = along,
                        .across = across,
                        .columns = length(along) / unit,
                        .rows = length(across) / unit});
  };
  side(low + z, x, -z);       // front
  side(high, -x, -z);         // back
  side(low + y + z, -y, -z);  // left
  side(low + x + z, y, -z);   // right
  side(low + y + z, x, -y);   // top
  side(low, x, y);            // bottom
}

/// Appends a ball with its poles along z, with `cuts` divisions from pole to pole and twice as many
/// around: 4 cuts (cuts - 1) triangles with the ball's normals. The picture covers the ball once.
inline void append_ball(PicturedMesh& mesh, Vec3 centre, double radius, int cuts) {
  const int about = 2 * cuts;
  const auto first = static_cast<uint32_t>(mesh.positions.size());
  for (int i = 0; i <= cuts; ++i)
    for (int j = 0; j <= about; ++j) {
      const double down = std::numbers::pi * i / cuts;
      const double turn = 2.0 * std::numbers::pi * (j % about) / about;
      const double ring = i == 0 || i == cuts ? 0.0 : std::sin(down);
      const Vec3 normal{ring * std::cos(turn), ring * std::sin(turn), std::cos(down)};
      append_point(mesh, centre + normal * radius, static_cast<double>(j) / about,
                   static_cast<double>(i) / cuts);
      mesh.normals.push_back(normal);
    }
  const auto point = [&](int i, int j) {
    return first + static_cast<uint32_t>(i * (about + 1) + j);
  };
  for (int i = 0; i < cuts; ++i)
    for (int j = 0; j < about; ++j) {
      if (i + 1 < cuts)
        mesh.triangles.push_back({point(i, j), point(i + 1, j), point(i + 1, j + 1)});
      if (i > 0) mesh.triangles.push_back({point(i, j), point(i + 1, j + 1), point(i, j + 1)});
    }
}

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

/// Appends a number with nine digits. Adding 0 turns -0 into 0.
template <class Out>
Out format_number(Out out, double number) {
  return fmt::format_to(out, "{:.9g}", number + 0.0);
}

/// Returns the number that a reader of the text gets for a number: with nine significant digits,
/// which exceeds single precision, and without a negative zero.
[[nodiscard]] inline double as_read_from_nff(double number) {
  char digits[32];
  const char* const end = format_number(digits, number);
  double read = 0.0;
  std::from_chars(digits, end, read);
  return read;
}

inline void append_part(std::string& text, std::string_view word) { text += word; }

inline void append_part(std::string& text, double number) {
  format_number(std::back_inserter(text += ' '), number);
}

inline void append_part(std::string& text, const Vec3& v) {
  for (const double number : {v.x, v.y, v.z}) append_part(text, number);
}

inline void round_part(std::string_view) {}

inline void round_part(int) {}

inline void round_part(double& number) { number = as_read_from_nff(number); }

inline void round_part(Vec3& v) {
  for (double* const number : {&v.x, &v.y, &v.z}) round_part(*number);
}

/// Passes the words and the numbers of an element's text to `take`, in their order.
template <class Kind, class Take>
void each_part(Kind& e, Take&& take) {
  using Plain = std::remove_const_t<Kind>;
  if constexpr (std::is_same_v<Plain, View>) {
    take("v\nfrom", e.from, "\nat", e.at, "\nup", e.up, "\nangle", e.angle_degrees);
    take("\nhither", e.hither, "\nresolution", e.resolution, e.resolution, "\n");
  } else if constexpr (std::is_same_v<Plain, Background>) {
    take("b", e.colour, "\n");
  } else if constexpr (std::is_same_v<Plain, PointLight>) {
    take("l", e.position);
    if (!(e.colour == Vec3{1, 1, 1})) take(e.colour);
    take("\n");
  } else if constexpr (std::is_same_v<Plain, Fill>) {
    take("f", e.colour, e.diffuse, e.specular, e.shine, e.transmittance, e.refraction_index, "\n");
  } else if constexpr (std::is_same_v<Plain, Sphere>) {
    take("s", e.centre, e.radius, "\n");
  } else if constexpr (std::is_same_v<Plain, Cone>) {
    take("c\n", e.base, e.base_radius, "\n", e.apex, e.apex_radius, "\n");
  } else {
    const bool smooth = !e.normals.empty();
    const std::string head = fmt::format("{} {}\n", smooth ? "pp" : "p", e.corners.size());
    take(head);
    for (size_t i = 0; i < e.corners.size(); ++i) {
      take(e.corners[i]);
      if (smooth) take(e.normals[i]);
      take("\n");
    }
  }
}

class NffWriter {
 public:
  /// Writes each line of `text` as a comment line.
  void comment(std::string_view text) {
    while (!text.empty()) {
      const size_t end = std::min(text.find('\n'), text.size());
      text_ += "# ";
      text_ += text.substr(0, end);
      text_ += '\n';
      text.remove_prefix(std::min(end + 1, text.size()));
    }
  }
  void add(const Element& element) {
    const auto append = [this](const auto&... parts) { (append_part(text_, parts), ...); };
    std::visit([&](const auto& kind) { each_part(kind, append); }, element);
  }

  [[nodiscard]] std::string take() { return std::move(text_); }

 private:
  std::string text_;
};

/// Returns the scene as NFF text, without its textured meshes. Comments come after all other lines,
/// because some readers take a comment for the end of the file.
[[nodiscard]] inline std::string nff_text(const SceneParts& parts) {
  NffWriter out;
  for (const Element& element : parts.elements) out.add(element);
  for (const std::string& comment : parts.comments) out.comment(comment);
  return out.take();
}

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
  /// Adds white lights.
  void lights(std::initializer_list<Vec3> positions) {
    for (const Vec3 position : positions) light(position);
  }
  void fill(const Fill& fill) { add(fill); }
  void sphere(Vec3 centre, double radius) { add(Sphere{centre, radius}); }
  /// Adds an open cone; a cylinder if both radii are equal.
  void cone(Vec3 base, double base_radius, Vec3 apex, double apex_radius) {
    add(Cone{base, base_radius, apex, apex_radius});
  }
  /// Adds a flat, convex polygon; some readers of NFF do not triangulate concave ones.
  void polygon(std::span<const Vec3> corners) { add(Polygon{{corners.begin(), corners.end()}}); }
  /// Adds a square that faces up, with its centre on the z axis.
  void square(double half, double z) {
    polygon(std::array{Vec3{half, half, z}, Vec3{-half, half, z}, Vec3{-half, -half, z},
                       Vec3{half, -half, z}});
  }
  void patch(std::span<const SurfacePoint> corners) {
    Polygon polygon;
    for (const SurfacePoint& corner : corners) {
      polygon.corners.push_back(corner.position);
      polygon.normals.push_back(corner.normal);
    }
    add(std::move(polygon));
  }
  /// Adds a textured mesh. Changes the fill of the following primitives.
  void pictured(PicturedMesh mesh) {
    if (pictures_ == Pictures::Plain) return write_plain(mesh);
    parts_.counts.polygons += static_cast<int>(mesh.triangles.size());
    parts_.pictured.push_back(std::move(mesh));
  }
  void comment(const std::string& text) { parts_.comments.push_back(text); }

  [[nodiscard]] SceneParts take() { return std::move(parts_); }

 private:
  void add(Element element) {
    const auto round = [](auto&... parts) { (round_part(parts), ...); };
    std::visit([&](auto& kind) { each_part(kind, round); }, element);
    SceneCounts& counts = parts_.counts;
    counts.polygons += std::holds_alternative<Polygon>(element) ? 1 : 0;
    counts.spheres += std::holds_alternative<Sphere>(element) ? 1 : 0;
    counts.cones += std::holds_alternative<Cone>(element) ? 1 : 0;
    counts.lights += std::holds_alternative<PointLight>(element) ? 1 : 0;
    parts_.elements.push_back(std::move(element));
  }
  void write_plain(const PicturedMesh& mesh) {
    if (!said_plain_)
      comment("NFF has no pictures: surfaces that wear one have its mean colour here");
    said_plain_ = true;
    Fill plain = mesh.fill;
    plain.colour = plain.colour * mesh.picture->mean();
    fill(plain);
    for (const auto& [a, b, c] : mesh.triangles) {
      const auto& p = mesh.positions;
      const auto& n = mesh.normals;
      if (n.empty())
        polygon(std::array{p[a], p[b], p[c]});
      else
        patch(std::array{SurfacePoint{p[a], n[a]}, SurfacePoint{p[b], n[b]},
                         SurfacePoint{p[c], n[c]}});
    }
  }

  Pictures pictures_;
  SceneParts parts_;
  bool said_plain_ = false;
};

inline void write_board(SceneWriter& out, SharedPicture picture, const Fill& fill,
                        const PicturedBoard& board) {
  PicturedMesh mesh{.fill = fill, .picture = std::move(picture)};
  append_board(mesh, board);
  out.pictured(std::move(mesh));
}

/// Writes a square that faces up, with its centre on the z axis, and its picture `count` times
/// along each edge.
inline void write_floor(SceneWriter& out, SharedPicture picture, const Fill& fill, double half,
                        double z, int count) {
  write_board(out, std::move(picture), fill,
              {.corner = {-half, half, z},
               .along = {2 * half, 0, 0},
               .across = {0, -2 * half, 0},
               .columns = static_cast<double>(count),
               .rows = static_cast<double>(count)});
}

inline void write_ball(SceneWriter& out, SharedPicture picture, const Fill& fill,
                       const Sphere& ball, int cuts) {
  PicturedMesh mesh{.fill = fill, .picture = std::move(picture)};
  append_ball(mesh, ball.centre, ball.radius, cuts);
  out.pictured(std::move(mesh));
}

struct CheckerBoard {
  Vec3 corner;
  Vec3 along;   ///< edge that is divided into columns
  Vec3 across;  ///< edge that is divided into rows; the visible side is along x across
  int columns = 1;
  int rows = 1;
  Fill even;  ///< fill of the square at the corner
  Fill odd;
};

inline void write_squares(SceneWriter& out, const CheckerBoard& board, int parity) {
  // Corners are computed from the whole edge, so that neighbouring squares share them exactly.
  const auto point = [&](int column, int row) {
    return board.corner + board.along * (static_cast<double>(column) / board.columns) +
           board.across * (static_cast<double>(row) / board.rows);
  };
  for (int row = 0; row < board.rows; ++row)
    for (int column = (row + parity) % 2; column < board.columns; column += 2)
      out.polygon(std::array{point(column, row), point(column + 1, row), point(column + 1, row + 1),
                             point(column, row + 1)});
}

inline void write_checker_board(SceneWriter& out, const CheckerBoard& board) {
  out.fill(board.even);
  write_squares(out, board, 0);
  out.fill(board.odd);
  write_squares(out, board, 1);
}

}  // namespace lenticule::scenes
