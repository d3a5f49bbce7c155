// SPDX-License-Identifier: Apache-2.0
#include "render/loaders/nff.h"

#include <fmt/format.h>

#include <cmath>
#include <limits>
#include <utility>

#include "render/loaders/formats.h"
#include "render/loaders/mesh_cleanup.h"
#include "render/loaders/text_reader.h"
#include "render/scene/stage.h"

namespace lenticule::render {

SceneDescription NffScene::finish() {
  const bool empty = scene_.meshes.empty() && scene_.spheres.empty() && scene_.cones.empty();
  if (!empty) finish_lights();
  const auto note_dropped = [&](int count, const char* what) {
    if (count > 0) scene_.notes.push_back(fmt::format("{} {}", count, what));
  };
  note_dropped(dropped_.flat_polygons, "polygons without an area dropped");
  note_dropped(dropped_.crossed_polygons, "polygons whose outline crosses itself, filled roughly");
  note_dropped(dropped_.empty_spheres, "spheres of radius 0 dropped");
  note_dropped(dropped_.empty_cones, "cones without a surface dropped");
  note_dropped(dropped_.repaired_normals, "normals of length 0 replaced by their polygon's");
  if (dropped_.material_missing)
    scene_.notes.emplace_back("objects before the first fill: rendered in white");
  if (empty) refuse_empty(scene_);
  return std::move(scene_);
}

/// Sets the lights' intensities, which the format leaves open. The usual recommendation is
/// sqrt(n) / 2n for each of n lights, so that scenes with many lights are neither overexposed nor
/// dark.
void NffScene::finish_lights() {
  const double n = static_cast<double>(scene_.lights.size());
  const double each = n > 0 ? std::sqrt(n) / (2.0 * n) : 0.0;
  for (Light& light : scene_.lights) light.colour = light.colour * each;
  if (scene_.lights.empty()) {
    scene_.notes.emplace_back("no light in the file; a default light is used");
    return;
  }
  // Keeps shadows readable without washing the picture out.
  scene_.ambient = Vec3{1, 1, 1} * (each / 4.0);
}

void NffScene::fill(Material m) {
  // Opaque fills often state 0 here.
  if (!(m.refraction_index > 0.0)) m.refraction_index = 1.0;
  m.tinted_specular = false;
  m.two_sided = true;
  current_material_ = material_index(m);
}

/// Returns the index of a material. Equal materials are shared, since files repeat the same fill
/// before every object, and one material each would also mean one mesh each.
int NffScene::material_index(const Material& m) {
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

int NffScene::material() {
  if (current_material_ < 0) {
    dropped_.material_missing = true;
    current_material_ = material_index(Material{.colour = {1, 1, 1}, .diffuse = 0.8});
  }
  return current_material_;
}

void NffScene::sphere(Vec3 centre, double radius) {
  if (radius == 0.0) return void(++dropped_.empty_spheres);
  scene_.spheres.push_back({.centre = centre,
                            .radius = std::abs(radius),
                            .inward = radius < 0.0,
                            .material = material()});
}

void NffScene::cone(Vec3 base, double base_radius, Vec3 apex, double apex_radius) {
  if ((base_radius == 0.0 && apex_radius == 0.0) || base == apex)
    return void(++dropped_.empty_cones);
  scene_.cones.push_back({.base = base,
                          .base_radius = std::abs(base_radius),
                          .apex = apex,
                          .apex_radius = std::abs(apex_radius),
                          .inward = base_radius < 0.0 || apex_radius < 0.0,
                          .material = material()});
}

bool NffScene::polygon(std::span<const Vec3> corners, std::span<const Vec3> normals) {
  const Triangulation cut = triangulate(corners);
  if (cut.triangles.empty()) {
    ++dropped_.flat_polygons;
    return true;
  }
  if (!cut.simple) ++dropped_.crossed_polygons;
  TriangleMesh& mesh = this->mesh(!normals.empty());
  if (mesh.positions.size() + corners.size() > kMaxVertices) return false;
  const auto first = static_cast<uint32_t>(mesh.positions.size());
  mesh.positions.insert(mesh.positions.end(), corners.begin(), corners.end());
  append_normals(mesh, corners, normals);
  for (const auto& [a, b, c] : cut.triangles)
    mesh.triangles.push_back({first + a, first + b, first + c});
  return true;
}

void NffScene::append_normals(TriangleMesh& mesh, std::span<const Vec3> corners,
                              std::span<const Vec3> normals) {
  if (normals.empty()) return;
  const Vec3 face = normalized(polygon_area_vector(corners));
  for (const Vec3 normal : normals) {
    const Vec3 unit = normalized(normal);
    const bool usable = std::abs(length(unit) - 1.0) < 1e-6;
    mesh.normals.push_back(usable ? unit : face);
    dropped_.repaired_normals += usable ? 0 : 1;
  }
}

/// Returns the mesh for the current material: one for polygons and one for patches.
TriangleMesh& NffScene::mesh(bool smooth) {
  const int m = material();
  int& index = mesh_of_[static_cast<size_t>(m)][smooth ? 1 : 0];
  if (index < 0) {
    index = static_cast<int>(scene_.meshes.size());
    const char* what = smooth ? "patches" : "polygons";
    scene_.meshes.push_back({.name = fmt::format("{} of fill {}", what, m + 1), .material = m});
  }
  return scene_.meshes[static_cast<size_t>(index)];
}

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
    if (keyword == "p" || keyword == "pp") return polygon(keyword == "pp");
    reader_.fail(
        fmt::format("unknown line {}, expected v, b, l, f, s, c, p or pp", quoted(keyword)));
  }

  // ---- camera and lights

  void view() {
    const int line = reader_.line();
    if (scene_.has_view()) reader_.fail("a second view");
    Camera camera{.name = "view"};
    camera.from = reader_.point(expected("from"));
    camera.at = reader_.point(expected("at"));
    camera.up = reader_.point(expected("up"));
    camera.vertical_fov_degrees = reader_.number_in(expected("angle"), 1e-3, 179.0);
    camera.hither = reader_.number_in(expected("hither"), 0.0, kMaxCoordinate);
    // Ignored, since the panel determines the size of the picture.
    (void)reader_.integer_in(expected("resolution"), 0, std::numeric_limits<int>::max());
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

  /// Takes the word `name` and returns it.
  const char* expected(const char* name) {
    const auto word = reader_.word();
    if (!word) reader_.fail(fmt::format("the file ends before the view's '{}'", name));
    if (*word != name)
      reader_.fail(fmt::format("expected the view's '{}', not {}", name, quoted(*word)));
    return name;
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

  void polygon(bool with_normals) {
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
      if (with_normals) normals_.push_back(reader_.point("a normal"));
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

}  // namespace lenticule::render
