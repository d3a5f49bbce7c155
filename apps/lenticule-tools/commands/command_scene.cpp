// SPDX-License-Identifier: Apache-2.0
// lenticule scene lists and writes the built-in scenes, and reports what a scene file holds and
// what of it is shown.
#include <fmt/format.h>
#include <fmt/ranges.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <filesystem>
#include <memory>
#include <nlohmann/json.hpp>
#include <optional>
#include <vector>

#include "apps/lenticule-tools/cli/render_flags.h"
#include "apps/lenticule-tools/offline/scene_sequence.h"
#include "apps/lenticule-tools/offline/thumbnail.h"
#include "apps/lenticule/cli/command.h"
#include "apps/lenticule/cli/option.h"
#include "base/error_kinds.h"
#include "base/file.h"
#include "base/print.h"
#include "frames/image_io.h"
#include "render/loaders/load_scene.h"
#include "render/scene/scene_description.h"
#include "render/scene/stage.h"
#include "render/scene/surroundings.h"
#include "scenes/scene_list.h"

namespace lenticule::tools {
namespace {

using nlohmann::json;

const char* kind_of(const render::Light& light) {
  constexpr const char* kNames[] = {"point", "directional", "spot"};
  return kNames[static_cast<size_t>(light.kind)];
}

json to_json(Vec3 v) { return {v.x, v.y, v.z}; }

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

json selection_json(const render::Selection& of) {
  json list = json::array();
  for (const std::string& name : of.names)
    list.push_back(
        {{"name", name}, {"number", list.size() + 1}, {"chosen", of.takes(list.size())}});
  return list;
}

json cameras_json(const render::SceneDescription& scene) {
  json list = json::array();
  for (const render::Camera& camera : scene.cameras)
    list.push_back({{"name", camera.name},
                    {"number", list.size() + 1},
                    {"chosen", std::ssize(list) == scene.camera},
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

/// Returns "1 walk (chosen), 2 run", at most sixteen entries.
std::string choices_text(const json& entries) {
  constexpr size_t kMost = 16;
  std::string text;
  for (const json& entry : entries) {
    const auto number = entry["number"].get<size_t>();
    if (number > kMost) return text + ", ... (--json lists all)";
    text += fmt::format("{}{} {}{}", number > 1 ? ", " : "", number, name_in(entry),
                        entry["chosen"].get<bool>() ? " (chosen)" : "");
  }
  return text;
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

/// Returns the report about a loaded scene. `up` is the world axis that is up on a panel.
json scene_report(const render::SceneDescription& scene, Vec3 up) {
  size_t triangles = 0;
  size_t vertices = 0;
  size_t meshes = scene.shapes.size();
  for (const render::TriangleMesh& mesh : scene.meshes) {
    meshes += mesh.shape < 0 ? 1 : 0;
    triangles += scene.shape_of(mesh).triangles.size();
    vertices += scene.shape_of(mesh).positions.size();
  }
  const auto moving = std::count_if(scene.nodes.begin(), scene.nodes.end(),
                                    [](const render::Node& node) { return node.animated; });
  const Box bounds = render::scene_bounds(scene);
  return {{"scene", scene.source},
          {"meshes", meshes},
          {"instances", scene.meshes.size()},
          {"triangles", triangles},
          {"vertices", vertices},
          {"spheres", scene.spheres.size()},
          {"cones", scene.cones.size()},
          {"materials", materials_json(scene)},
          {"textures", textures_json(scene)},
          {"lights", lights_json(scene)},
          {"default_light", scene.lights.empty() && !scene.ambient},
          {"cameras", cameras_json(scene)},
          {"scenes", selection_json(scene.scenes)},
          {"animations", selection_json(scene.animations)},
          {"variants", selection_json(scene.variants)},
          {"nodes", scene.nodes.size()},
          {"animated_nodes", moving},
          {"duration_seconds", scene.duration_seconds},
          {"low", to_json(bounds.low)},
          {"high", to_json(bounds.high)},
          {"up", axis_name(up)},
          {"notes", scene.notes}};
}

/// Prints the report for people.
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
  print_entry("cameras", r["cameras"].empty() ? "none: the scene is fitted into the panel"
                                              : choices_text(r["cameras"]));
  print_entry("animation", animation_text(r));
  for (const char* kind : {"animations", "variants", "scenes"})
    if (!r[kind].empty()) print_entry(kind, choices_text(r[kind]));
  print_entry("size", bounds_text(r));
  for (const json& note : r["notes"]) print_entry("note", note);
  if (r["notes"].empty()) print_entry("notes", "none");
}

struct SceneFlags {
  std::string name;
  std::optional<int> size;
  int frame = 0;
  std::string output;
  std::string camera;
  bool json = false;
  std::string shown;      ///< file of 'show'
  std::string thumbnail;  ///< output of 'show'
  render::LoadOptions load;
};

nlohmann::json to_json(const scenes::SceneCounts& counts) {
  return {{"primitives", counts.primitives()},
          {"polygons", counts.polygons},
          {"spheres", counts.spheres},
          {"cones", counts.cones},
          {"lights", counts.lights}};
}

/// Returns the list; counts are those of the default size.
nlohmann::json list_as_json() {
  nlohmann::json list = nlohmann::json::array();
  for (const scenes::BuiltInScene& scene : scenes::scene_list()) {
    const scenes::SceneParts parts = scenes::build_scene(scene);
    nlohmann::json entry = to_json(parts.counts);
    entry.update({{"name", scene.name},
                  {"summary", scene.summary},
                  {"frames", scene.frames},
                  {"only_camera_moves", scene.only_camera_moves},
                  {"wears_pictures", !parts.pictured.empty()},
                  {"size_meaning", scene.size_meaning},
                  {"default_size", scene.default_size},
                  {"largest_size", scene.largest_size}});
    list.push_back(entry);
  }
  return list;
}

void print_list(const nlohmann::json& list) {
  for (const auto& scene : list) {
    const auto frames = scene["frames"].get<int>();
    print_out(
        "{0:<12} {1}\n{2:<12} {3} primitives, {4} lights, {5}{6}\n"
        "{2:<12} size {7} (1..{8}): {9}\n",
        scene["name"].get<std::string>(), scene["summary"].get<std::string>(), "",
        scene["primitives"].get<int>(), scene["lights"].get<int>(),
        frames == 1 ? "still" : fmt::format("{} frames", frames),
        scene["wears_pictures"].get<bool>() ? ", pictures" : "", scene["default_size"].get<int>(),
        scene["largest_size"].get<int>(), scene["size_meaning"].get<std::string>());
  }
}

/// Writes one scene. With --camera and without -o, writes only the camera.
void write_one(const SceneFlags& flags) {
  const bool to_standard_output = flags.output.empty() && flags.camera.empty();
  if (flags.json && to_standard_output)
    throw Error(ErrorKind::Usage,
                "scene: --json needs -o FILE, because the scene is written to standard output",
                "'lenticule scene list --json' lists the scenes");
  const scenes::BuiltInScene& scene = scenes::find_scene(flags.name);
  if (!flags.output.empty() && std::filesystem::path(flags.output).extension() != ".nff")
    throw usage_error("{}: scenes are written as .nff", flags.output)
        .remedy("use a name that ends in .nff");
  const std::string text = scenes::write_scene(scene, flags.size, flags.frame);
  if (to_standard_output) return print_out("{}", Verbatim{text});
  nlohmann::json done = {{"name", scene.name},
                         {"size", flags.size.value_or(scene.default_size)},
                         {"frame", flags.frame},
                         {"frames", scene.frames}};
  if (!flags.camera.empty()) {
    write_text_file(flags.camera, scenes::write_camera_path(scene, flags.size));
    done["camera"] = flags.camera;
  }
  if (!flags.output.empty()) {
    write_text_file(flags.output, text);
    std::vector<std::string> notes;  // about what the format cannot express
    if (!scenes::build_scene(scene, 1).pictured.empty())
      notes.emplace_back(
          "NFF has no textures: textured surfaces have their mean colour; 'lenticule render "
          "builtin:NAME' shows the textures");
    done.update(to_json(scenes::build_scene(scene, flags.size, flags.frame).counts));
    done.update({{"output", flags.output}, {"bytes", text.size()}, {"notes", notes}});
    for (const std::string& note : notes) say("{}: {}\n", flags.output, note);
  }
  if (flags.json) print_json(done);
}

void show_scene(const SceneFlags& flags) {
  if (!flags.thumbnail.empty()) frames::check_writable_format(flags.thumbnail);
  render::SceneDescription scene = flags.shown.starts_with("builtin:")
                                       ? SceneSequence(flags.shown, {}, flags.load).at(0)
                                       : render::load_scene(flags.shown, flags.load);
  std::optional<render::SceneDescription> baked;
  if (!scene.nodes.empty()) baked = render::at_time(scene, 0.0);
  render::SceneDescription& first = baked ? *baked : scene;
  const FlatView view = make_flat_view(first);
  nlohmann::json report = scene_report(scene, render::world_up(view.stage));
  const render::InView in_view = render::content_in_view(first, view.stage, view.model);
  if (in_view == render::InView::Nothing)
    report["notes"].push_back("nothing is seen: all of it lies outside the camera's view");
  if (in_view == render::InView::BackFaces) {
    report["notes"].push_back(render::kBothSides);
    render::show_both_sides(first);
  }
  if (!flags.thumbnail.empty()) {
    write_thumbnail(first, view, flags.thumbnail);
    report["output"] = flags.thumbnail;
  }
  print_result(report, flags.json, print_scene_report);
}

CLI::App* declare_show(CLI::App& app, const std::shared_ptr<SceneFlags>& flags) {
  CLI::App* sub =
      app.add_subcommand("show", "print what a scene file holds and what of it is seen");
  sub->footer("Example:\n  lenticule scene show model.glb -o thumbnail.png");
  sub->add_option("SCENE", flags->shown, "scene file, or builtin:NAME[:SIZE]")->required();
  cli::add_option(*sub, "-o,--output FILE", flags->thumbnail,
                  "picture of the scene as its camera sees it: .png, .tif, .exr or .ppm");
  sub->add_flag("--json", flags->json, "print as JSON");
  declare_model_flags(*sub, flags->load);
  return sub;
}

}  // namespace

cli::Run declare_scene(CLI::App& app) {
  auto flags = std::make_shared<SceneFlags>();
  const CLI::App* const show_app = declare_show(app, flags);
  app.add_option("NAME", flags->name, "a scene's name, or 'list'");
  app.add_option("--size", flags->size, "how fine or how many; 'list' explains it for each scene");
  cli::add_option(app, "--frame", flags->frame, "frame of the scene's sequence");
  cli::add_option(app, "-o,--output FILE", flags->output, "file to write, .nff")
      ->default_str("NFF on standard output");
  cli::add_option(
      app, "--camera FILE", flags->camera,
      "file for the camera of every frame, in the format of 'lenticule render --camera'");
  app.add_flag("--json", flags->json, "print what was listed or written as JSON");
  return [flags, show_app]() -> ExitCode {
    if (show_app->parsed())
      show_scene(*flags);
    else if (flags->name == "list")
      print_result(list_as_json(), flags->json, print_list);
    else if (!flags->name.empty())
      write_one(*flags);
    else
      throw Error(ErrorKind::Usage, "scene: NAME is missing", "see lenticule scene list");
    return kOk;
  };
}
}  // namespace lenticule::tools
