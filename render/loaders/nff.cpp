// SPDX-License-Identifier: Apache-2.0
#include "render/loaders/nff.h"

#include <fmt/format.h>

#include <limits>
#include <vector>

#include "base/error.h"
#include "base/file.h"
#include "render/loaders/limits.h"
#include "render/loaders/nff_scene.h"
#include "render/loaders/text_reader.h"
#include "render/scene/camera_pose.h"

namespace lenticule::render {
namespace {

class NffParser {
 public:
  NffParser(std::string_view text, const std::string& source)
      : reader_(text, source), scene_(source) {}

  SceneDescription parse() {
    while (const auto keyword = reader_.word()) line(*keyword);
    return scene_.finish();
  }

 private:
  void line(std::string_view keyword) {
    if (keyword == "v") return view();
    if (keyword == "b") return scene_.background(reader_.colour("the background colour"));
    if (keyword == "l") return light();
    if (keyword == "f") return fill();
    if (keyword == "s") return sphere();
    if (keyword == "c") return cone();
    if (keyword == "p") return polygon(Corners::Plain);
    if (keyword == "pp") return polygon(Corners::WithNormals);
    reader_.fail(
        fmt::format("unknown line {}, expected v, b, l, f, s, c, p or pp", quoted(keyword)));
  }

  // ---- camera and lights

  void view() {
    const int line = reader_.line();
    if (scene_.has_view()) reader_.fail("a second view");
    Camera camera{.name = "view"};
    expect("from");
    camera.from = reader_.point("from");
    expect("at");
    camera.at = reader_.point("at");
    expect("up");
    camera.up = reader_.point("up");
    expect("angle");
    camera.vertical_fov_degrees = reader_.number_in("angle", 1e-3, 179.0);
    expect("hither");
    camera.hither = reader_.number_in("hither", 0.0, kMaxCoordinate);
    expect("resolution");
    // Ignored, since the panel determines the size of the picture.
    (void)reader_.integer_in("resolution", 0, std::numeric_limits<int>::max());
    (void)reader_.integer_in("resolution", 0, std::numeric_limits<int>::max());
    if (camera.from == camera.at)
      reader_.fail_at(line, "the view's from and at are the same point");
    if (!up_is_usable(camera)) {
      camera.up = any_perpendicular(camera.at - camera.from);
      scene_.note(fmt::format(
          "line {}: the view's up is parallel to its direction; another up is used", line));
    }
    scene_.view(camera);
  }

  void expect(std::string_view name) {
    const auto word = reader_.word();
    if (!word) reader_.fail(fmt::format("the file ends before the view's '{}'", name));
    if (*word != name)
      reader_.fail(fmt::format("expected the view's '{}', not {}", name, quoted(*word)));
  }

  void light() {
    if (scene_.lights() == kMaxLights) reader_.fail(fmt::format("more than {} lights", kMaxLights));
    const Vec3 position = reader_.point("the light's place");
    Vec3 colour{1, 1, 1};
    if (reader_.number_follows()) colour = reader_.colour("the light's colour");
    scene_.light(position, colour);
  }

  // ---- materials

  void fill() {
    constexpr double kMost = 1e6;
    Material m;
    m.colour = reader_.colour("the fill colour");
    m.diffuse = reader_.number_in("Kd", 0.0, kMost);
    m.specular = reader_.number_in("Ks", 0.0, kMost);
    m.shine = reader_.number_in("Shine", 0.0, kMost);
    m.transmittance = reader_.number_in("T", 0.0, 1.0);
    m.refraction_index = reader_.number_in("the index of refraction", 0.0, 100.0);
    scene_.fill(m);
  }

  // ---- primitives

  void sphere() {
    const Vec3 centre = reader_.point("the sphere's centre");
    scene_.sphere(centre,
                  reader_.number_in("the sphere's radius", -kMaxCoordinate, kMaxCoordinate));
  }

  void cone() {
    const int line = reader_.line();
    const Vec3 base = reader_.point("the cone's base");
    const double base_radius =
        reader_.number_in("the base radius", -kMaxCoordinate, kMaxCoordinate);
    const Vec3 apex = reader_.point("the cone's apex");
    const double apex_radius =
        reader_.number_in("the apex radius", -kMaxCoordinate, kMaxCoordinate);
    if (base_radius * apex_radius < 0.0)
      reader_.fail_at(line, "the cone's radii have different signs");
    scene_.cone(base, base_radius, apex, apex_radius);
  }

  enum class Corners { Plain, WithNormals };

  void polygon(Corners kind) {
    const int line = reader_.line();
    const int count =
        reader_.integer_in("the number of corners", 0, std::numeric_limits<int>::max());
    if (count < 3) reader_.fail("a polygon needs at least 3 corners");
    if (count > kMaxPolygonVertices)
      reader_.fail(
          fmt::format("a polygon of {} corners, the limit is {}", count, kMaxPolygonVertices));
    corners_.clear();
    normals_.clear();
    for (int i = 0; i < count; ++i) {
      corners_.push_back(reader_.point("a corner"));
      if (kind == Corners::WithNormals) normals_.push_back(reader_.point("a normal"));
    }
    if (!scene_.polygon(corners_, normals_))
      reader_.fail_at(line, fmt::format("more than {} corners of one material", kMaxVertices));
  }

  TextReader reader_;
  NffScene scene_;
  std::vector<Vec3> corners_;
  std::vector<Vec3> normals_;
};

}  // namespace

SceneDescription parse_nff(std::string_view text, const std::string& source) {
  return NffParser(text, source).parse();
}

SceneDescription load_nff(const std::filesystem::path& file) {
  const std::vector<uint8_t> bytes = read_whole_file(file, kMaxSceneFileBytes);
  return parse_nff({reinterpret_cast<const char*>(bytes.data()), bytes.size()}, file.string());
}

}  // namespace lenticule::render
