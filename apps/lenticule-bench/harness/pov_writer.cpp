// SPDX-License-Identifier: Apache-2.0
#include "apps/lenticule-bench/harness/pov_writer.h"

#include <fmt/format.h>

#include <cmath>
#include <iterator>
#include <numbers>
#include <span>

#include "base/error.h"

namespace lenticule::player {
namespace {

std::string vector_text(Vec3 v) {
  return fmt::format("<{:.9g}, {:.9g}, {:.9g}>", v.x + 0.0, v.y + 0.0, v.z + 0.0);
}

void check(const render::SceneDescription& scene) {
  const auto refuse = [&](const char* what) {
    throw Error(ErrorKind::Usage, fmt::format("{}: {}", scene.source, what));
  };
  if (scene.cameras.empty()) refuse("scenes without a camera cannot be written for POV-Ray");
  if (!scene.nodes.empty()) refuse("scenes with nodes cannot be written for POV-Ray");
  for (const render::Material& material : scene.materials)
    if (material.texture >= 0) refuse("textures cannot be written for POV-Ray");
  for (const render::Light& light : scene.lights)
    if (light.kind != render::Light::Kind::Point || light.falls_off)
      refuse("only point lights without falloff can be written for POV-Ray");
}

class PovText {
 public:
  PovText(const render::SceneDescription& scene, const PovOptions& options)
      : scene_(scene), options_(options) {}

  std::string write() {
    settings();
    camera(scene_.cameras.front());
    for (const render::Light& light : scene_.lights)
      line("light_source {{ {} color rgb {} }}", vector_text(light.position),
           vector_text(light.colour));
    for (size_t i = 0; i < scene_.materials.size(); ++i) material(i);
    for (const render::TriangleMesh& each : scene_.meshes) mesh(each);
    for (const render::Sphere& sphere : scene_.spheres)
      line("sphere {{ {}, {:.9g} material {{ M{} }} }}", vector_text(sphere.centre), sphere.radius,
           sphere.material);
    for (const render::Cone& each : scene_.cones) cone(each);
    return std::move(text_);
  }

 private:
  template <class... Arguments>
  void line(fmt::format_string<Arguments...> format, Arguments&&... arguments) {
    fmt::format_to(std::back_inserter(text_), format, std::forward<Arguments>(arguments)...);
    text_ += '\n';
  }

  void settings() {
    line("#version 3.7;");
    // POV-Ray's trace level counts the camera rays as the first level. Colours are code values, as
    // in the project's NFF scenes.
    line("global_settings {{ max_trace_level {} assumed_gamma srgb ambient_light rgb 1 }}",
         options_.max_depth + 1);
    line("background {{ color rgb {} }}", vector_text(scene_.background));
  }

  /// Writes the camera. "right" is negated because POV-Ray's coordinates are left-handed; "angle"
  /// is the horizontal one.
  void camera(const render::Camera& camera) {
    constexpr double kDegree = std::numbers::pi / 180.0;
    const double half = std::tan(camera.vertical_fov_degrees / 2.0 * kDegree) * options_.aspect;
    line("camera {{ perspective location {} sky {} up y right -{:.9g}*x angle {:.9g} look_at {} }}",
         vector_text(camera.from), vector_text(camera.up), options_.aspect,
         2.0 * std::atan(half) / kDegree, vector_text(camera.at));
  }

  void material(size_t index) {
    const render::Material& m = scene_.materials[index];
    const Vec3 ambient = scene_.ambient.value_or(Vec3{}) * m.diffuse;
    line("#declare M{} = material {{ texture {{", index);
    line("  pigment {{ color rgb {} transmit {:.9g} }}", vector_text(m.colour), m.transmittance);
    line("  finish {{ ambient rgb {} diffuse {:.9g} phong {:.9g} phong_size {:.9g}",
         vector_text(ambient), m.diffuse, m.specular, m.shine);
    line("    reflection {:.9g} }} }} interior {{ ior {:.9g} }} }}", m.specular,
         m.refraction_index);
  }

  template <class Values, class Text>
  void list(const char* name, const Values& values, Text text_of) {
    line("  {} {{ {}", name, values.size());
    for (const auto& value : values) line("    ,{}", text_of(value));
    line("  }}");
  }

  void mesh(const render::TriangleMesh& mesh) {
    if (mesh.triangles.empty()) return;
    line("mesh2 {{");
    list("vertex_vectors", mesh.positions, vector_text);
    if (!mesh.normals.empty()) list("normal_vectors", mesh.normals, vector_text);
    list("face_indices", mesh.triangles, [](const std::array<uint32_t, 3>& corner) {
      return fmt::format("<{}, {}, {}>", corner[0], corner[1], corner[2]);
    });
    line("  material {{ M{} }} }}", mesh.material);
  }

  void cone(const render::Cone& cone) {
    if (cone.base_radius == cone.apex_radius)
      line("cylinder {{ {}, {}, {:.9g} open material {{ M{} }} }}", vector_text(cone.base),
           vector_text(cone.apex), cone.base_radius, cone.material);
    else
      line("cone {{ {}, {:.9g}, {}, {:.9g} open material {{ M{} }} }}", vector_text(cone.base),
           cone.base_radius, vector_text(cone.apex), cone.apex_radius, cone.material);
  }

  const render::SceneDescription& scene_;
  const PovOptions& options_;
  std::string text_;
};

}  // namespace

std::string write_pov(const render::SceneDescription& scene, const PovOptions& options) {
  check(scene);
  return PovText(scene, options).write();
}

}  // namespace lenticule::player
