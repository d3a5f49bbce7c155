// SPDX-License-Identifier: Apache-2.0
#include "render/loaders/load_scene.h"

#include <fmt/format.h>
#include <tbb/task_arena.h>

#include <algorithm>
#include <array>
#include <atomic>
#include <fstream>
#include <string_view>
#include <vector>

#include "base/error_kinds.h"
#include "base/misnamed_file.h"
#include "base/numbers.h"
#include "base/text.h"
#include "render/loaders/animation.h"
#include "render/loaders/formats.h"
#include "render/loaders/nff.h"
#include "render/loaders/scene_files.h"
#include "render/loaders/text_reader.h"

namespace lenticule::render {
namespace {

/// Axes by their names, with the rotation that makes each of them point to +y.
struct AxisTurn {
  std::string_view name;
  UpAxis axis;
  Affine turn;
};

constexpr std::array<AxisTurn, 6> kAxes{{
    {"x", UpAxis::X, {{0, 1, 0}, {-1, 0, 0}, {0, 0, 1}, {}}},
    {"y", UpAxis::Y, {}},
    {"z", UpAxis::Z, {{1, 0, 0}, {0, 0, -1}, {0, 1, 0}, {}}},
    {"-x", UpAxis::MinusX, {{0, -1, 0}, {1, 0, 0}, {0, 0, 1}, {}}},
    {"-y", UpAxis::MinusY, {{1, 0, 0}, {0, -1, 0}, {0, 0, -1}, {}}},
    {"-z", UpAxis::MinusZ, {{1, 0, 0}, {0, 0, 1}, {0, -1, 0}, {}}},
}};

/// Habit of a format that does not state which axis points up.
struct UpHabit {
  std::string_view extension;
  UpAxis up;
  bool turned_already;  ///< the loader turns the scene by itself
};
constexpr std::array<UpHabit, 4> kUpHabits{{{".3ds", UpAxis::Z, true},
                                            {".obj", UpAxis::Y, false},
                                            {".ply", UpAxis::Z, false},
                                            {".stl", UpAxis::Z, false}}};

/// Turns the scene so that y is up, and notes the format's habit if that decides.
void set_up_axis(SceneDescription& scene, const std::string& extension,
                 const std::optional<UpAxis>& wanted) {
  const auto* const habit = std::ranges::find(kUpHabits, extension, &UpHabit::extension);
  if (habit == kUpHabits.end()) return turn_upright(scene, wanted.value_or(UpAxis::Y));
  if (!wanted)
    scene.notes.push_back(fmt::format(
        "{} is taken as up, as is usual in {} files, which do not say (--up {} if the model lies "
        "down)",
        habit->up == UpAxis::Z ? "z" : "y", extension, habit->up == UpAxis::Z ? "y" : "z"));
  if (!habit->turned_already) return turn_upright(scene, wanted.value_or(habit->up));
  if (!wanted) return;
  turn_upright(scene, UpAxis::MinusZ);  // undoes the loader's turn
  turn_upright(scene, *wanted);
}

/// Formats with a reader of our own, and those whose reader in assimp is still looked after. The
/// others of assimp crash or fill the memory, some even for files that are not damaged.
constexpr std::array<std::string_view, 21> kFormats{
    ".3ds", ".ac",  ".ac3d", ".acc", ".amf", ".ase", ".dae", ".dxf", ".fbx", ".glb", ".gltf",
    ".lwo", ".nff", ".obj",  ".off", ".ply", ".stl", ".x3d", ".xgl", ".zae", ".zgl"};

void require_format(const std::filesystem::path& file, bool any) {
  const std::string extension = lower_case(file.extension().string());
  if (std::ranges::find(kFormats, extension) != kFormats.end()) return;
  if (!assimp_reads(extension))
    throw input_error("{}: unknown scene format '{}'", file.string(), extension)
        .remedy("use .glb, .gltf, .obj, .ply, .stl, .fbx, .dae or .nff");
  if (!any)
    throw input_error(
        "{}: models in {} are not read: their only reader, of assimp, crashes too often",
        file.string(), extension)
        .remedy("convert it to glTF (.glb), for example in Blender, or try --any-format");
}

void require_file(const std::filesystem::path& file) {
  std::error_code error;
  const auto status = std::filesystem::status(file, error);
  if (!std::filesystem::exists(status))
    throw input_error("{}: no such file", file.string())
        .remedy("correct the name; built-in scenes are named builtin:demo");
  if (!std::filesystem::is_regular_file(status))
    throw input_error("{}: not a regular file", file.string());
  const std::string extension = lower_case(file.extension().string());
  std::array<char, 64> bytes{};
  if (std::ifstream(file, std::ios::binary).read(bytes.data(), bytes.size()).gcount() == 0)
    throw input_error("{}: empty, or cannot be read", file.string()).remedy("copy it anew");
  const std::string_view head(bytes.data(), bytes.size());
  bool is_shown = head.substr(4, 4) == "ftyp";  // MP4, MOV, HEIC, AVIF
  for (const std::string_view begin : {"\x1a\x45\xdf\xa3", "RIFF", "GIF8"})
    is_shown |= head.starts_with(begin);
  for (const std::string_view name : {".png", ".jpg", ".jpeg", ".lts"})
    is_shown |= extension == name;
  if (is_shown)
    throw input_error("{}: a picture or a film, not a model", file.string())
        .remedy("name it as what it is, and show it with lenticule play");
  if (const auto is = recognise_misnamed(head, extension))
    throw input_error("{}: {}", file.string(), is->what).remedy(std::string(is->remedy));
}

/// Refuses numbers of vertices, faces and edges that an OFF file has no room for: assimp would
/// allocate memory for them.
void check_off(const std::filesystem::path& file) {
  const std::vector<uint8_t> bytes = read_scene_file(file);
  TextReader text(text_of(bytes), file.string());
  std::string_view word = text.word().value_or("");
  if (word.ends_with("OFF")) word = text.word().value_or("");
  for (int n = 0; n < 3; ++n, word = text.word().value_or(""))
    if (const auto count = number_from<uint64_t>(word); !count || *count > bytes.size() / 2)
      text.fail(fmt::format("{} vertices, faces or edges in a file of {} bytes",
                            render::quoted(word), bytes.size()));
}

SceneDescription load(const std::filesystem::path& file, const std::string& extension,
                      const ViewerChoices& wanted) {
  const std::string source = file.string();
  if (extension == ".nff") return parse_nff(text_of(read_scene_file(file)), source);
  if (extension == ".gltf" || extension == ".glb")
    return parse_gltf(read_scene_file(file), source, file.parent_path(), wanted);
  if (extension == ".obj") return parse_obj(read_scene_file(file), file);
  if (extension == ".ply") return parse_ply(read_scene_file(file), source, file.parent_path());
  if (extension == ".stl") return parse_stl(read_scene_file(file), source);
  if (extension == ".off") check_off(file);
  return load_with_assimp(file, wanted);
}

std::atomic<const SceneReader*> chosen_reader{nullptr};

}  // namespace

UpAxis up_axis_named(const std::string& name) {
  const auto* const found = std::ranges::find(kAxes, name, &AxisTurn::name);
  if (found == kAxes.end())
    throw usage_error("--up '{}': not an axis", name).remedy("axes are x, y, z, -x, -y and -z");
  return found->axis;
}

void turn_upright(SceneDescription& scene, UpAxis up) {
  if (up == UpAxis::Y) return;
  transform_scene(scene, std::ranges::find(kAxes, up, &AxisTurn::axis)->turn);
}

void use_scene_reader(const SceneReader* reader) noexcept { chosen_reader.store(reader); }

SceneDescription load_scene(const std::filesystem::path& file, const LoadOptions& options) {
  require_file(file);
  require_format(file, options.any_format);
  const SceneReader* const reader = chosen_reader.load();
  SceneDescription scene =
      reader != nullptr ? reader->load(file, options) : load_scene_here(file, options);
  apply_choices(scene, options.choices);
  return scene;
}

void prepare_loaders() {
  (void)tbb::this_task_arena::max_concurrency();
  (void)assimp_reads(".stl");
}

SceneDescription load_scene_here(const std::filesystem::path& file, const LoadOptions& options) {
  const std::string extension = lower_case(file.extension().string());
  SceneDescription scene;
  try {
    scene = load(file, extension, options.choices);
  } catch (const Error& error) {
    if (!error.hint().empty() || !std::string_view(error.what()).starts_with(file.string())) throw;
    throw Error(error.kind(), error.what(),
                "correct the file, or save it again, best as glTF (.glb)");
  }
  set_up_axis(scene, extension, options.up);
  // NFF states what other renderers of that format show.
  scene.lit_by_studio = extension != ".nff";
  return scene;
}

}  // namespace lenticule::render
