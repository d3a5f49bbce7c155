// SPDX-License-Identifier: Apache-2.0
#include "lab/judges/peers.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <string_view>

#include "base/error.h"
#include "base/numbers.h"
#include "render/scene/texture.h"
#include "scenes/scene_writer.h"

namespace lenticule::lab {
namespace {

/// Returns the mean colour of a texture, its appearance from far away.
Vec3 mean_colour(const render::Texture& texture) {
  Vec3 sum;
  const size_t texels = std::max(texture.rgba.size(), texture.codes.size()) / 4;
  for (size_t i = 0; i < texels; ++i)
    sum += Vec3{render::texel_light(texture, i, 0), render::texel_light(texture, i, 1),
                render::texel_light(texture, i, 2)};
  return sum / std::max(1.0, static_cast<double>(texels));
}

scenes::Fill fill_of(const render::SceneDescription& scene, const render::Material& m) {
  const bool textured = m.texture >= 0;
  return {.colour = textured
                        ? m.colour * mean_colour(*scene.textures[static_cast<size_t>(m.texture)])
                        : m.colour,
          .diffuse = m.diffuse,
          .specular = m.specular,
          .shine = m.shine,
          .transmittance = m.transmittance,
          .refraction_index = m.refraction_index};
}

void write_mesh(scenes::NffWriter& out, const render::TriangleMesh& mesh) {
  for (const auto& [a, b, c] : mesh.triangles) {
    const auto& p = mesh.positions;
    const auto& n = mesh.normals;
    scenes::Polygon triangle{.corners = {p[a], p[b], p[c]}};
    if (!n.empty()) triangle.normals = {n[a], n[b], n[c]};
    out.add(triangle);
  }
}

}  // namespace

std::vector<std::string> tachyon_arguments(const std::string& scene_file, const PeerJob& job) {
  std::vector<std::string> arguments = {
      scene_file, "-res", std::to_string(job.width), std::to_string(job.height), "-numthreads",
      std::to_string(job.threads),
      // The camera rays count as the first level.
      "-raydepth", std::to_string(job.max_depth + 1), "-fullshade"};
  if (job.picture.empty())
    arguments.emplace_back("-nosave");
  else
    arguments.insert(arguments.end(), {"-format", "PPM", "-o", job.picture});
  return arguments;
}

std::optional<double> tachyon_seconds(const std::string& output) {
  constexpr std::string_view kBefore = "Ray Tracing Time:";
  const size_t place = output.rfind(kBefore);
  if (place == std::string::npos) return std::nullopt;
  std::string_view rest = std::string_view(output).substr(place + kBefore.size());
  rest.remove_prefix(std::min(rest.find_first_not_of(" \t\r\n"), rest.size()));
  const auto number = take_number<double>(rest);
  return number.value_or(-1.0) < 0.0 ? std::nullopt : number;
}

double tachyon_target(const std::string& scene) {
  if (scene == "teapot") return 6.0;
  if (scene == "balls") return 12.0;
  return scene == "tree" ? 30.0 : 0.0;
}

std::string write_plain_nff(const render::SceneDescription& scene) {
  if (scene.cameras.empty())
    throw Error(ErrorKind::Usage, fmt::format("{}: has no camera, which NFF needs", scene.source));
  scenes::NffWriter out;
  const render::Camera& camera = scene.cameras.front();
  out.add(scenes::View{.from = camera.from,
                       .at = camera.at,
                       .up = camera.up,
                       .angle_degrees = camera.vertical_fov_degrees});
  out.add(scenes::Background{scene.background});
  for (const render::Light& light : scene.lights) out.add(scenes::PointLight{light.position});
  for (size_t i = 0; i < scene.materials.size(); ++i) {
    const auto wears = [i](const auto& object) {
      return static_cast<size_t>(object.material) == i;
    };
    out.add(fill_of(scene, scene.materials[i]));
    render::for_each_mesh(scene, [&](const render::TriangleMesh& mesh) {
      if (wears(mesh)) write_mesh(out, mesh);
    });
    for (const auto& sphere : scene.spheres)
      if (wears(sphere))
        out.add(scenes::Sphere{sphere.centre, sphere.inward ? -sphere.radius : sphere.radius});
    for (const auto& cone : scene.cones)
      if (wears(cone)) {
        const double side = cone.inward ? -1.0 : 1.0;
        out.add(
            scenes::Cone{cone.base, side * cone.base_radius, cone.apex, side * cone.apex_radius});
      }
  }
  return out.take();
}

PeerJob peer_picture(double rays, double aspect) {
  const double height = std::sqrt(rays / aspect);
  PeerJob job;
  job.height = std::max(1, static_cast<int>(std::lround(height)));
  job.width = std::max(1, static_cast<int>(std::lround(rays / job.height)));
  return job;
}

}  // namespace lenticule::lab
