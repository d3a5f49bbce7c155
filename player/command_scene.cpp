// SPDX-License-Identifier: Apache-2.0
// lenticule scene: lists and writes the built-in scenes.
#include <fmt/format.h>

#include <cerrno>
#include <cstdio>
#include <cstring>
#include <memory>
#include <optional>

#include "frames/atomic_file.h"
#include "optics/error.h"
#include "player/command.h"
#include "scenes/scene_list.h"

namespace lenticule::player {
namespace {

struct SceneFlags {
  std::string name;
  std::optional<int> size;
  int frame = 0;
  std::string output;
  bool json = false;
};

nlohmann::json list_as_json() {
  nlohmann::json list = nlohmann::json::array();
  for (const scenes::BuiltInScene& scene : scenes::scene_list())
    list.push_back({{"name", scene.name},
                    {"summary", scene.summary},
                    {"frames", scene.frames},
                    {"size_meaning", scene.size_meaning},
                    {"default_size", scene.default_size},
                    {"largest_size", scene.largest_size}});
  return list;
}

void print_list(const nlohmann::json& list) {
  for (const auto& scene : list)
    fmt::print("{:<12} {}\n{:<12} {} frames, size {} (1..{}: {})\n",
               scene["name"].get<std::string>(), scene["summary"].get<std::string>(), "",
               scene["frames"].get<int>(), scene["default_size"].get<int>(),
               scene["largest_size"].get<int>(), scene["size_meaning"].get<std::string>());
}

void write_to_standard_output(const std::string& text) {
  if (std::fwrite(text.data(), 1, text.size(), stdout) != text.size() || std::fflush(stdout) != 0)
    throw Error(ErrorKind::Failed, fmt::format("standard output: {}", std::strerror(errno)));
}

void write_one(const SceneFlags& flags) {
  if (flags.json && flags.output.empty())
    throw Error(ErrorKind::Usage, "scene: --json needs -o FILE, standard output is the scene's",
                "'lenticule scene list --json' prints what there is");
  const scenes::BuiltInScene& scene = scenes::find_scene(flags.name);
  const std::string text = scenes::write_scene(scene, flags.size, flags.frame);
  if (flags.output.empty()) return write_to_standard_output(text);
  frames::write_file_atomically(flags.output,
                                {reinterpret_cast<const uint8_t*>(text.data()), text.size()});
  if (flags.json)
    print_json({{"name", scene.name},
                {"size", flags.size.value_or(scene.default_size)},
                {"frame", flags.frame},
                {"frames", scene.frames},
                {"output", flags.output},
                {"bytes", text.size()}});
}

}  // namespace

Run declare_scene(CLI::App& app) {
  auto flags = std::make_shared<SceneFlags>();
  app.add_option("NAME", flags->name, "a scene's name, or 'list'")->required();
  app.add_option("--size", flags->size, "how fine or how many; 'list' says what it counts");
  app.add_option("--frame", flags->frame, "frame of the scene's sequence")->capture_default_str();
  app.add_option("-o,--output", flags->output, "NFF file to write; standard output if left out");
  app.add_flag("--json", flags->json, "print what was listed or written as JSON");
  return [flags]() -> ExitCode {
    if (flags->name != "list") {
      write_one(*flags);
      return kOk;
    }
    const nlohmann::json list = list_as_json();
    if (flags->json)
      print_json(list);
    else
      print_list(list);
    return kOk;
  };
}

}  // namespace lenticule::player
