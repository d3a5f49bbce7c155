// SPDX-License-Identifier: Apache-2.0
// lenticule scene lists and writes the built-in scenes, and shows what a scene file holds.
#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <filesystem>
#include <memory>
#include <optional>
#include <utility>

#include "apps/lenticule-tools/commands/scene_report.h"
#include "apps/lenticule-tools/offline/built_in_scene.h"
#include "apps/lenticule-tools/offline/gltf_writer.h"
#include "apps/lenticule-tools/offline/scene_sequence.h"
#include "apps/lenticule-tools/offline/thumbnail.h"
#include "apps/lenticule/cli/command.h"
#include "base/error.h"
#include "base/file.h"
#include "base/print.h"
#include "frames/image_io.h"
#include "render/loaders/load_scene.h"
#include "render/scene/stage.h"
#include "render/scene/surroundings.h"
#include "scenes/scene_list.h"

namespace lenticule::tools {
namespace {

struct SceneFlags {
  std::string name;
  std::optional<int> size;
  int frame = 0;
  std::string output;
  std::string camera;
  bool json = false;
  std::string shown;      ///< file of 'show'
  std::string thumbnail;  ///< output of 'show'
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

std::string frames_text(int frames) {
  return frames == 1 ? "still" : fmt::format("{} frames", frames);
}

void print_list(const nlohmann::json& list) {
  for (const auto& scene : list)
    print_out(
        "{0:<12} {1}\n{2:<12} {3} primitives, {4} lights, {5}{6}\n"
        "{2:<12} size {7} (1..{8}): {9}\n",
        scene["name"].get<std::string>(), scene["summary"].get<std::string>(), "",
        scene["primitives"].get<int>(), scene["lights"].get<int>(),
        frames_text(scene["frames"].get<int>()),
        scene["wears_pictures"].get<bool>() ? ", pictures" : "", scene["default_size"].get<int>(),
        scene["largest_size"].get<int>(), scene["size_meaning"].get<std::string>());
}

void write_text(const std::string& file, const std::string& text) {
  write_file_atomically(file, {reinterpret_cast<const uint8_t*>(text.data()), text.size()});
}

/// A scene as text of a file, with notes about what the format cannot express.
struct Written {
  std::string text;
  std::vector<std::string> notes;
};

Written as_nff(const scenes::BuiltInScene& scene, const SceneFlags& flags) {
  Written written{scenes::write_scene(scene, flags.size, flags.frame), {}};
  if (!scenes::build_scene(scene, 1).pictured.empty())
    written.notes.emplace_back(
        "NFF has no textures: textured surfaces have their mean colour; 'lenticule render "
        "builtin:NAME' shows the textures");
  return written;
}

Written as_gltf(const scenes::BuiltInScene& scene, const SceneFlags& flags) {
  GltfText gltf = write_gltf(describe_built_in(scene, flags.size, flags.frame));
  return {std::move(gltf.json), std::move(gltf.notes)};
}

Written written_as(const std::string& output, const scenes::BuiltInScene& scene,
                   const SceneFlags& flags) {
  const std::string extension = std::filesystem::path(output).extension().string();
  if (output.empty() || extension == ".nff") return as_nff(scene, flags);
  if (extension == ".gltf") return as_gltf(scene, flags);
  throw Error(ErrorKind::Usage, fmt::format("{}: scenes are written as .nff or .gltf", output),
              "use a name that ends in .nff or .gltf");
}

/// Writes one scene. With --camera and without -o, writes only the camera.
void write_one(const SceneFlags& flags) {
  const bool to_standard_output = flags.output.empty() && flags.camera.empty();
  if (flags.json && to_standard_output)
    throw Error(ErrorKind::Usage,
                "scene: --json needs -o FILE, because the scene is written to standard output",
                "'lenticule scene list --json' lists the scenes");
  const scenes::BuiltInScene& scene = scenes::find_scene(flags.name);
  const Written written = written_as(flags.output, scene, flags);
  if (to_standard_output) return print_out("{}", Verbatim{written.text});
  nlohmann::json done = {{"name", scene.name},
                         {"size", flags.size.value_or(scene.default_size)},
                         {"frame", flags.frame},
                         {"frames", scene.frames}};
  if (!flags.camera.empty()) {
    write_text(flags.camera, scenes::write_camera_path(scene, flags.size));
    done["camera"] = flags.camera;
  }
  if (!flags.output.empty()) {
    write_text(flags.output, written.text);
    done.update(to_json(scenes::build_scene(scene, flags.size, flags.frame).counts));
    done.update(
        {{"output", flags.output}, {"bytes", written.text.size()}, {"notes", written.notes}});
    for (const std::string& note : written.notes) say("{}: {}\n", flags.output, note);
  }
  if (flags.json) print_json(done);
}

render::SceneDescription load_any(const std::string& scene) {
  return scene.starts_with("builtin:") ? SceneSequence(scene, frames::Rate{}).at(0)
                                       : render::load_scene(scene);
}

void show_scene(const SceneFlags& flags) {
  if (!flags.thumbnail.empty()) frames::check_writable_format(flags.thumbnail);
  const render::SceneDescription scene = load_any(flags.shown);
  const render::SceneDescription first = render::at_time(scene, 0.0);
  const FlatView view = make_flat_view(first);
  nlohmann::json report = scene_report(scene, render::world_up(view.stage));
  if (!render::content_meets_rays(first, view.stage, view.model))
    report["notes"].push_back("nothing is seen: all of it lies outside the camera's view");
  if (!flags.thumbnail.empty()) {
    write_thumbnail(first, view, flags.thumbnail);
    report["output"] = flags.thumbnail;
  }
  if (flags.json)
    print_json(report);
  else
    print_scene_report(report);
}

CLI::App* declare_show(CLI::App& app, const std::shared_ptr<SceneFlags>& flags) {
  CLI::App* sub =
      app.add_subcommand("show", "print what a scene file holds and what of it is seen");
  sub->footer("Example:\n  lenticule scene show model.glb -o thumbnail.png");
  sub->add_option("SCENE", flags->shown, "scene file, or builtin:NAME[:SIZE]")->required();
  sub->add_option("-o,--output", flags->thumbnail,
                  "picture of the scene as its camera sees it: .png, .tif, .exr or .ppm")
      ->type_name("FILE");
  sub->add_flag("--json", flags->json, "print as JSON");
  return sub;
}

void list(const SceneFlags& flags) {
  const nlohmann::json list = list_as_json();
  if (flags.json)
    print_json(list);
  else
    print_list(list);
}

}  // namespace

cli::Run declare_scene(CLI::App& app) {
  auto flags = std::make_shared<SceneFlags>();
  const CLI::App* const show_app = declare_show(app, flags);
  app.add_option("NAME", flags->name, "a scene's name, or 'list'");
  app.add_option("--size", flags->size, "how fine or how many; 'list' explains it for each scene");
  app.add_option("--frame", flags->frame, "frame of the scene's sequence")->capture_default_str();
  app.add_option("-o,--output", flags->output, "file to write, .nff or .gltf")
      ->type_name("FILE")
      ->default_str("NFF on standard output");
  app.add_option("--camera", flags->camera,
                 "file for the camera of every frame, in the format of 'lenticule render --camera'")
      ->type_name("FILE");
  app.add_flag("--json", flags->json, "print what was listed or written as JSON");
  return [flags, show_app]() -> ExitCode {
    if (show_app->parsed())
      show_scene(*flags);
    else if (flags->name == "list")
      list(*flags);
    else if (!flags->name.empty())
      write_one(*flags);
    else
      throw Error(ErrorKind::Usage, "scene: NAME is missing", "see lenticule scene list");
    return kOk;
  };
}

}  // namespace lenticule::tools
