// SPDX-License-Identifier: Apache-2.0
// A scene file names other files. SceneFiles finds and reads them; a process without rights has
// another process do it.
#pragma once

#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

namespace lenticule::render {

/// Thread safety: any thread.
class SceneFiles {
 public:
  virtual ~SceneFiles() = default;
  /// Does what named_file() says.
  [[nodiscard]] virtual std::filesystem::path find(const std::filesystem::path& folder,
                                                   const std::string& name) const = 0;
  /// Does what read_scene_file() says.
  [[nodiscard]] virtual std::vector<uint8_t> read(const std::filesystem::path& file) const = 0;
};

/// Makes the loaders reach files through `files`; with null they do it themselves (the default).
///
/// Lifetime: `files` must live until the process ends or null is set.
void use_scene_files(const SceneFiles* files) noexcept;

/// Returns the bytes of a scene file, or of a file that a scene names. Throws Error(Input) that
/// names the file and the cause.
[[nodiscard]] std::vector<uint8_t> read_scene_file(const std::filesystem::path& file);

/// Returns the path of a file that a scene in `folder` names. Tries the name with forward slashes,
/// then percent-decoded, then with letters of another case, and for a name with folders also the
/// file of that name beside the scene. Returns the first of these that exists, else folder / name.
[[nodiscard]] std::filesystem::path named_file(const std::filesystem::path& folder,
                                               const std::string& name);

}  // namespace lenticule::render
