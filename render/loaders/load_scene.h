// SPDX-License-Identifier: Apache-2.0
// load_scene reads a scene file of any supported format. UpAxis names the axis that points up,
// which many formats do not state.
#pragma once

#include <filesystem>
#include <optional>
#include <string>

#include "render/loaders/viewer_choices.h"
#include "render/scene/scene_description.h"

namespace lenticule::render {

enum class UpAxis { X, Y, Z, MinusX, MinusY, MinusZ };

/// Returns the axis named "x", "y", "z", "-x", "-y" or "-z". Throws Error(Usage) for other names.
[[nodiscard]] UpAxis up_axis_named(const std::string& name);

/// Rotates the whole scene by a multiple of a quarter turn, so that the axis points to +y.
void turn_upright(SceneDescription& scene, UpAxis up);

struct LoadOptions {
  /// The file's axis that points up; default: as the format has it. The message that asks
  /// lenticule-reader for a scene has it, too, and the choices.
  std::optional<UpAxis> up{};
  bool any_format = false;  ///< also formats whose reader in assimp crashes often
  ViewerChoices choices{};
};

/// Loads a file in any supported format, chosen by its extension; y is up in the result,
/// and the studio lights it where the file has no lights, except in NFF. Throws
/// Error(Input) with the file, the line or JSON path if the format has one, and the reason.
/// Non-finite vertices are errors. Zero-area triangles are dropped and noted; zero or non-finite
/// normals are recomputed and noted.
[[nodiscard]] SceneDescription load_scene(const std::filesystem::path& file,
                                          const LoadOptions& options = {});

/// SceneReader loads files elsewhere. Thread safety: any thread.
class SceneReader {
 public:
  virtual ~SceneReader() = default;
  /// Throws the errors of load_scene().
  [[nodiscard]] virtual SceneDescription load(const std::filesystem::path& file,
                                              const LoadOptions& options) const = 0;
};

/// Makes load_scene() use `reader`; with null, this process parses the files (the default).
///
/// Lifetime: `reader` must live until the process ends or null is set.
void use_scene_reader(const SceneReader* reader) noexcept;

/// Does what load_scene() says in this process, for a file that exists, except apply_choices().
[[nodiscard]] SceneDescription load_scene_here(const std::filesystem::path& file,
                                               const LoadOptions& options);

/// Makes libraries read what they need of the system, before the process is confined. Starts no
/// thread.
void prepare_loaders();

}  // namespace lenticule::render
