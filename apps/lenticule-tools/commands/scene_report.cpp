// SPDX-License-Identifier: Apache-2.0
#include "apps/lenticule-tools/commands/scene_report.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <vector>

#include "base/print.h"
#include "render/scene/stage.h"

namespace lenticule::tools {
namespace {

using nlohmann::json;

const char* kind_of(const render::Light& light) {
  switch (light.kind) {
    case render::Light::Kind::Point:
      return "point";
    case render::Light::Kind::Directional:
      return "directional";
    case render::Light::Kind::Spot:
      return "spot";
  }
  return "";
}

json to_json(Vec3 v) {
  return {v.x, v.y, v.z};
}

std::string axis_name(Vec3 axis) {
  const double sum = axis.x + axis.y + axis.z;
  const char* letter = axis.x != 0.0 ? "x" : axis.y != 0.0 ? "y" : "z";
  return (sum < 0.0 ? "-" : "+") + std::string(letter);
}

json materials_json(const render::SceneDescription& scene) {
  json list = json::array();
  for (const render::Material& material : scene.materials)
    list.push_back(
        {{"name", material.name}, {"model", material.pbr ? "metallic-roughness" : "whitted"}});
  return list;
}

json textures_json(const render::SceneDescription& scene) {
  json list = json::array();
  for (const auto& texture : scene.textures)
    if (texture)
      list.push_back(
          {{"name", texture->name}, {"width", texture->width}, {"height", texture->height}});
  return list;
}

json cameras_json(const render::SceneDescription& scene) {
  json list = json::array();
  for (const render::Camera& camera : scene.cameras)
    list.push_back({{"name", camera.name},
                    {"from", to_json(camera.from)},
                    {"at", to_json(camera.at)},
                    {"vertical_fov_degrees", camera.vertical_fov_degrees}});
  return list;
}

/// Returns how many lights of each kind there are.
json lights_json(const render::SceneDescription& scene) {
  json counts = json::object();
  for (const render::Light& light : scene.lights)
    counts[kind_of(light)] = counts.value(kind_of(light), 0) + 1;
  return counts;
}

// ---- text

void print_entry(const char* what, const std::string& text) {
  print_out("{:<10} {}\n", what, text);
}

/// Returns "3: a, b, c", with at most eight names, or "none".
std::string named(const std::vector<std::string>& names) {
  constexpr size_t kMost = 8;
  if (names.empty()) return "none";
  const size_t shown = std::min(names.size(), kMost);
  return fmt::format("{}: {}{}", names.size(),
                     fmt::join(names.begin(), names.begin() + static_cast<ptrdiff_t>(shown), ", "),
                     names.size() > kMost ? ", ..." : "");
}

std::string name_in(const json& entry) {
  const std::string name = entry["name"];
  return name.empty() ? "unnamed" : name;
}

std::string surfaces_text(const json& r) {
  std::vector<std::string> parts;
  for (const char* kind : {"meshes", "triangles", "vertices", "spheres", "cones"})
    if (const auto count = r[kind].get<size_t>(); count > 0)
      parts.push_back(fmt::format("{} {}", count, kind));
  return fmt::format("{}", fmt::join(parts, ", "));
}

std::string lights_text(const json& r) {
  if (r["lights"].empty()) return r["default_light"] ? "none: a default one is added" : "none";
  std::vector<std::string> parts;
  for (const auto& [kind, count] : r["lights"].items())
    parts.push_back(fmt::format("{} {}", count.get<int>(), kind));
  return fmt::format("{}", fmt::join(parts, ", "));
}

std::string animation_text(const json& r) {
  const auto seconds = r["duration_seconds"].get<double>();
  if (!(seconds > 0.0)) return "none";
  return fmt::format("{:.3g} s, {} nodes move", seconds, r["animated_nodes"].get<size_t>());
}

std::string bounds_text(const json& r) {
  const auto side = [&](int axis) {
    return r["high"][axis].get<double>() - r["low"][axis].get<double>();
  };
  return fmt::format("{:.4g} x {:.4g} x {:.4g} units in x, y, z; {} is up", side(0), side(1),
                     side(2), r["up"].get<std::string>());
}

}  // namespace

json scene_report(const render::SceneDescription& scene, Vec3 up) {
  size_t triangles = 0;
  size_t vertices = 0;
  for (const render::TriangleMesh& mesh : scene.meshes) {
    triangles += mesh.triangles.size();
    vertices += mesh.positions.size();
  }
  const auto moving = std::count_if(scene.nodes.begin(), scene.nodes.end(),
                                    [](const render::Node& node) { return node.animated; });
  const render::Bounds bounds = render::scene_bounds(scene);
  return {{"scene", scene.source},
          {"meshes", scene.meshes.size()},
          {"triangles", triangles},
          {"vertices", vertices},
          {"spheres", scene.spheres.size()},
          {"cones", scene.cones.size()},
          {"materials", materials_json(scene)},
          {"textures", textures_json(scene)},
          {"lights", lights_json(scene)},
          {"default_light", scene.lights.empty() && !scene.ambient},
          {"cameras", cameras_json(scene)},
          {"nodes", scene.nodes.size()},
          {"animated_nodes", moving},
          {"duration_seconds", scene.duration_seconds},
          {"low", to_json(bounds.low)},
          {"high", to_json(bounds.high)},
          {"up", axis_name(up)},
          {"notes", scene.notes}};
}

void print_scene_report(const json& r) {
  print_entry("scene", r["scene"]);
  print_entry("surfaces", surfaces_text(r));
  std::vector<std::string> names;
  for (const json& material : r["materials"]) names.push_back(name_in(material));
  print_entry("materials", named(names));
  names.clear();
  for (const json& texture : r["textures"])
    names.push_back(fmt::format("{} {} x {}", name_in(texture), texture["width"].get<int>(),
                                texture["height"].get<int>()));
  print_entry("textures", named(names));
  print_entry("lights", lights_text(r));
  names.clear();
  for (const json& camera : r["cameras"])
    names.push_back(fmt::format("{} ({:.3g} degrees high)", name_in(camera),
                                camera["vertical_fov_degrees"].get<double>()));
  print_entry("cameras", names.empty() ? "none: the scene is fitted into the panel"
                                       : named(names) + "; the first is used");
  print_entry("animation", animation_text(r));
  print_entry("size", bounds_text(r));
  for (const json& note : r["notes"]) print_entry("note", note);
  if (r["notes"].empty()) print_entry("notes", "none");
}

}  // namespace lenticule::tools
