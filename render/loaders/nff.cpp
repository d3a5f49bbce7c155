// SPDX-License-Identifier: Apache-2.0
#include "render/loaders/nff.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>

#include "base/error.h"
#include "base/file.h"
#include "render/loaders/limits.h"
#include "render/loaders/polygon.h"
#include "render/loaders/text_reader.h"
#include "render/scene/camera_pose.h"

namespace lenticule::render {
namespace {

/// Primitives without effect on the picture, counted for the notes.
struct Dropped {
  int flat_polygons = 0;
  int empty_spheres = 0;
  int empty_cones = 0;
  int crossed_polygons = 0;
  int repaired_normals = 0;
  bool material_missing = false;
};

class NffParser {
 public:
  NffParser(std::string_view text, const std::string& source) : reader_(text, source) {
    scene_.source = source;
    scene_.colour_managed = false;
  }

  SceneDescription parse() {
    while (const auto keyword = reader_.word()) line(*keyword);
    finish_lights();
    write_notes();
    if (scene_.meshes.empty() && scene_.spheres.empty() && scene_.cones.empty())
      throw Error(ErrorKind::Input, scene_.source + ": nothing to see in this scene");
    return std::move(scene_);
  }

 private:
  void line(std::string_view keyword) {
    if (keyword == "v") return view();
    if (keyword == "b") return void(scene_.background = reader_.colour("the background colour"));
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
    if (!scene_.cameras.empty()) reader_.fail("a second view");
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
    if (camera.from == camera.at) reader_.fail_at(line, "the view's from and at are one point");
    if (!up_is_usable(camera)) {
      camera.up = any_perpendicular(camera.at - camera.from);
      scene_.notes.push_back(
          fmt::format("line {}: the view's up lies along its direction, another is used", line));
    }
    scene_.cameras.push_back(camera);
  }

  void expect(std::string_view name) {
    const auto word = reader_.word();
    if (!word) reader_.fail(fmt::format("the file ends before the view's '{}'", name));
    if (*word != name)
      reader_.fail(fmt::format("expected the view's '{}', not {}", name, quoted(*word)));
  }

  void light() {
    if (scene_.lights.size() == kMaxLights)
      reader_.fail(fmt::format("more than {} lights", kMaxLights));
    Light light{.kind = Light::Kind::Point};
    light.position = reader_.point("the light's place");
    if (reader_.number_follows()) light.colour = reader_.colour("the light's colour");
    scene_.lights.push_back(light);
  }

  /// Sets the lights' intensities, which the format leaves open. The usual recommendation is
  /// sqrt(n) / 2n for each of n lights, so that scenes with many lights are neither overexposed nor
  /// dark.
  void finish_lights() {
    const double n = static_cast<double>(scene_.lights.size());
    const double each = n > 0 ? std::sqrt(n) / (2.0 * n) : 0.0;
    for (Light& light : scene_.lights) light.colour = light.colour * each;
    if (scene_.lights.empty()) {
      scene_.notes.emplace_back("no light in the file: lit by a default one");
      return;
    }
    // Keeps shadows readable without washing the picture out.
    scene_.ambient = Vec3{1, 1, 1} * (each / 4.0);
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
    // Opaque fills often state 0 here.
    const double index = reader_.number_in("the index of refraction", 0.0, 100.0);
    m.refraction_index = index > 0.0 ? index : 1.0;
    m.tinted_specular = false;
    m.two_sided = true;
    current_material_ = material_index(m);
  }

  /// Returns the index of a material. Equal materials are shared, since files repeat the same fill
  /// before every object, and one material each would also mean one mesh each.
  int material_index(const Material& m) {
    const MaterialKey key{m.colour.x, m.colour.y, m.colour.z,      m.diffuse,
                          m.specular, m.shine,    m.transmittance, m.refraction_index};
    const auto [place, added] = materials_.try_emplace(key, scene_.materials.size());
    if (added) {
      scene_.materials.push_back(m);
      scene_.materials.back().name = fmt::format("fill {}", scene_.materials.size());
      mesh_of_.push_back({-1, -1});
    }
    return static_cast<int>(place->second);
  }

  int material() {
    if (current_material_ < 0) {
      dropped_.material_missing = true;
      current_material_ = material_index(Material{.colour = {1, 1, 1}, .diffuse = 0.8});
    }
    return current_material_;
  }

  // ---- primitives

  void sphere() {
    Sphere s;
    s.centre = reader_.point("the sphere's centre");
    const double radius = reader_.number_in("the sphere's radius", -kMaxCoordinate, kMaxCoordinate);
    if (radius == 0.0) return void(++dropped_.empty_spheres);
    s.radius = std::abs(radius);
    s.inward = radius < 0.0;
    s.material = material();
    scene_.spheres.push_back(s);
  }

  void cone() {
    const int line = reader_.line();
    Cone c;
    c.base = reader_.point("the cone's base");
    const double base = reader_.number_in("the base radius", -kMaxCoordinate, kMaxCoordinate);
    c.apex = reader_.point("the cone's apex");
    const double apex = reader_.number_in("the apex radius", -kMaxCoordinate, kMaxCoordinate);
    if (base * apex < 0.0) reader_.fail_at(line, "the cone's radii have different signs");
    if ((base == 0.0 && apex == 0.0) || c.base == c.apex) return void(++dropped_.empty_cones);
    c.base_radius = std::abs(base);
    c.apex_radius = std::abs(apex);
    c.inward = base < 0.0 || apex < 0.0;
    c.material = material();
    scene_.cones.push_back(c);
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
    const Triangulation cut = triangulate(corners_);
    if (cut.triangles.empty()) return void(++dropped_.flat_polygons);
    if (!cut.simple) ++dropped_.crossed_polygons;
    if (kind == Corners::WithNormals) unit_normals();
    append(mesh(kind), cut, line);
  }

  void unit_normals() {
    const Vec3 face = normalized(polygon_area_vector(corners_));
    for (Vec3& normal : normals_) {
      const Vec3 unit = normalized(normal);
      const bool usable = std::abs(length(unit) - 1.0) < 1e-6;
      normal = usable ? unit : face;
      dropped_.repaired_normals += usable ? 0 : 1;
    }
  }

  /// Returns the mesh for the current material: one for polygons and one for patches.
  TriangleMesh& mesh(Corners kind) {
    const int m = material();
    int& index = mesh_of_[static_cast<size_t>(m)][kind == Corners::Plain ? 0 : 1];
    if (index < 0) {
      index = static_cast<int>(scene_.meshes.size());
      const char* what = kind == Corners::Plain ? "polygons" : "patches";
      scene_.meshes.push_back({.name = fmt::format("{} of fill {}", what, m + 1), .material = m});
    }
    return scene_.meshes[static_cast<size_t>(index)];
  }

  void append(TriangleMesh& mesh, const Triangulation& cut, int line) {
    if (mesh.positions.size() + corners_.size() > kMaxVertices)
      reader_.fail_at(line, fmt::format("more than {} corners of one material", kMaxVertices));
    const auto first = static_cast<uint32_t>(mesh.positions.size());
    mesh.positions.insert(mesh.positions.end(), corners_.begin(), corners_.end());
    mesh.normals.insert(mesh.normals.end(), normals_.begin(), normals_.end());
    for (const auto& [a, b, c] : cut.triangles)
      mesh.triangles.push_back({first + a, first + b, first + c});
  }

  // ---- notes

  void note(int count, const char* what) {
    if (count > 0) scene_.notes.push_back(fmt::format("{} {}", count, what));
  }

  void write_notes() {
    note(dropped_.flat_polygons, "polygons without an area dropped");
    note(dropped_.crossed_polygons, "polygons whose outline crosses itself, filled roughly");
    note(dropped_.empty_spheres, "spheres of radius 0 dropped");
    note(dropped_.empty_cones, "cones without a surface dropped");
    note(dropped_.repaired_normals, "normals of length 0 replaced by their polygon's");
    if (dropped_.material_missing)
      scene_.notes.emplace_back("objects before the first fill: drawn in white");
  }

  using MaterialKey = std::array<double, 8>;

  TextReader reader_;
  SceneDescription scene_;
  Dropped dropped_;
  int current_material_ = -1;
  std::map<MaterialKey, size_t> materials_;
  std::vector<std::array<int, 2>> mesh_of_;  ///< per material: its polygon and its patch mesh
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
