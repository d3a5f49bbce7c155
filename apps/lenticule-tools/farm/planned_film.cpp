// SPDX-License-Identifier: Apache-2.0
#include "apps/lenticule-tools/farm/planned_film.h"

#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <thread>

#include "base/error.h"
#include "frames/image_io.h"
#include "frames/sequence/sequence_joiner.h"
#include "render/scene/scene_fingerprint.h"

namespace lenticule::tools {
namespace {

constexpr const char* kBuiltIn = "builtin:";

/// Mixes what the loader made of the files: also vertices in buffers and textures beside the scene.
void mix_scene(const render::SceneDescription& scene, render::SceneMixer& mixer) {
  mixer.add(scene.materials);
  mixer.add(scene.meshes);
  mixer.add(scene.spheres);
  mixer.add(scene.cones);
  mixer.add(scene.lights);
  mixer.add(scene.background);
  mixer.add(scene.ambient);
}

std::string digest_of_texture(const render::Texture& texture) {
  const auto bytes_of = [](const auto& values) {
    return std::string_view(reinterpret_cast<const char*>(values.data()),
                            values.size() * sizeof(values[0]));
  };
  return frames::digest_of_text(bytes_of(texture.codes)) +
         frames::digest_of_text(bytes_of(texture.rgba));
}

std::string digest_of_scene(const RenderFlags& flags, const FilmRenderer& renderer) {
  const SceneSequence& scenes = renderer.scenes();
  const render::SceneDescription reference = scenes.at(scenes.reference_frame());
  render::SceneMixer mixer;
  mix_scene(reference, mixer);
  if (!scenes.still() && !frames::FilePattern::looks_like_pattern(flags.scene))
    mix_scene(scenes.at(renderer.film().end - 1), mixer);
  std::string parts = flags.scene.starts_with(kBuiltIn) ? flags.scene : std::string();
  if (parts.empty() && !frames::FilePattern::looks_like_pattern(flags.scene))
    parts = frames::digest_of_file(flags.scene);
  parts += fmt::format(" {:016x}{:016x}", mixer.value().first, mixer.value().second);
  for (const auto& texture : reference.textures) parts += " " + digest_of_texture(*texture);
  return frames::digest_of_text(parts);
}

/// Returns the digest of what a film takes from its wall beside the rig: the place of the panel,
/// and the canvas, which depends on all panels.
std::string digest_of_place(const FilmPanel& panel) {
  const render::Canvas& canvas = panel.canvas;
  std::string text = fmt::format("{} {} {} {} {}", panel.name, canvas.width_mm, canvas.height_mm,
                                 canvas.depth_of_field_mm, canvas.viewing_distance_mm);
  const Affine& place = panel.canvas_from_panel;
  for (const Vec3& v : {place.column_x, place.column_y, place.column_z, place.origin})
    text += fmt::format(" {} {} {}", v.x, v.y, v.z);
  return frames::digest_of_text(text);
}

}  // namespace

std::string program_version() {
  return fmt::format("lenticule {}", LENTICULE_VERSION);
}

std::map<std::string, std::string> digests_of_inputs(const RenderFlags& flags,
                                                     const FilmRenderer& renderer) {
  std::map<std::string, std::string> digests;
  digests["scene"] = digest_of_scene(flags, renderer);
  digests["rig"] = optics::fingerprint(renderer.rig());
  if (renderer.panel().in_wall()) digests["wall"] = digest_of_place(renderer.panel());
  if (!flags.camera.empty()) digests["camera"] = frames::digest_of_file(flags.camera);
  const std::string& environment = flags.staging.surroundings.environment_file;
  if (!environment.empty()) digests["environment"] = frames::digest_of_file(environment);
  return digests;
}

std::string digest_of_chunk_inputs(const RenderFlags& flags, const farm::Chunk& chunk) {
  if (flags.scene.starts_with(kBuiltIn) || !frames::FilePattern::looks_like_pattern(flags.scene))
    return {};
  const frames::FilePattern pattern(flags.scene);
  std::string parts;
  for (uint64_t frame = chunk.begin; frame < chunk.end; ++frame)
    parts += frames::digest_of_file(pattern.path(frame));
  return frames::digest_of_text(parts);
}

PlannedFilm::PlannedFilm(const farm::Plan& plan, int threads) : plan_(plan) {
  if (plan.program != program_version())
    throw Error(ErrorKind::Input,
                fmt::format("the plan was made by {}, this is {}", plan.program, program_version()),
                "install the same version on all machines, or make a new plan");
  CLI::App app;
  const std::function<void()> complete = declare_render_flags(app, flags_);
  std::vector<std::string> arguments = plan.arguments;
  arguments.push_back(fmt::format("--frames={}:{}", plan.begin, plan.end));
  std::reverse(arguments.begin(), arguments.end());  // as CLI11 takes a list
  try {
    app.parse(arguments);
  } catch (const CLI::ParseError& error) {
    throw Error(ErrorKind::Input, fmt::format("plan.json: arguments: {}", error.what()));
  }
  complete();
  flags_.options.threads = threads;
  renderer_ = std::make_unique<FilmRenderer>(flags_, player::FrameRange{plan.begin, plan.end});
  for (const auto& [what, digest] : digests_of_inputs(flags_, *renderer_)) {
    const auto planned = plan.inputs.find(what);
    if (planned == plan.inputs.end() || planned->second != digest)
      throw Error(ErrorKind::Input,
                  fmt::format("{}: the {} is not the one of the plan", plan.output, what),
                  "put the planned file back, or make a new plan in a new folder");
  }
}

int PlannedFilm::threads() const {
  const int wanted = flags_.options.threads;
  return wanted > 0 ? wanted : static_cast<int>(std::thread::hardware_concurrency());
}

void PlannedFilm::require_inputs_of(const farm::Chunk& chunk) const {
  if (plan_.chunk_inputs.empty() ||
      plan_.chunk_inputs[chunk.number] == digest_of_chunk_inputs(flags_, chunk))
    return;
  throw Error(ErrorKind::Input,
              fmt::format("{}: frames {} to {} have changed since the plan was made", flags_.scene,
                          chunk.begin, chunk.end - 1),
              "put the planned files back, or make a new plan in a new folder");
}

}  // namespace lenticule::tools
