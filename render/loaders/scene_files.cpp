// SPDX-License-Identifier: Apache-2.0
#include "render/loaders/scene_files.h"

#include <algorithm>
#include <atomic>
#include <optional>
#include <system_error>

#include "base/file.h"
#include "base/text.h"
#include "render/loaders/formats.h"

namespace lenticule::render {
namespace {

bool is_there(const std::filesystem::path& file) {
  std::error_code error;
  return std::filesystem::exists(file, error);
}

/// Returns the first entry of a folder, by name, that differs from `name` in the case of letters
/// only.
std::optional<std::filesystem::path> entry_of_any_case(const std::filesystem::path& folder,
                                                       const std::filesystem::path& name) {
  const std::string wanted = lower_case(name.string());
  for (const std::filesystem::path& entry : entries_of(folder.empty() ? "." : folder))
    if (lower_case(entry.filename().string()) == wanted) return entry.filename();
  return std::nullopt;
}

/// Follows a relative path, one folder after the other.
std::optional<std::filesystem::path> path_of_any_case(const std::filesystem::path& folder,
                                                      const std::filesystem::path& name) {
  std::filesystem::path path = name.is_absolute() ? name.root_path() : folder;
  for (const std::filesystem::path& part : name.relative_path()) {
    if (is_there(path / part)) {
      path /= part;
      continue;
    }
    const auto entry = entry_of_any_case(path, part);
    if (!entry) return std::nullopt;
    path /= *entry;
  }
  return path;
}

std::atomic<const SceneFiles*> chosen_files{nullptr};

}  // namespace

void use_scene_files(const SceneFiles* files) noexcept { chosen_files.store(files); }

std::vector<uint8_t> read_scene_file(const std::filesystem::path& file) {
  if (const SceneFiles* const files = chosen_files.load()) return files->read(file);
  return read_whole_file(file, kMaxSceneFileBytes);
}

std::filesystem::path named_file(const std::filesystem::path& folder, const std::string& name) {
  if (const SceneFiles* const files = chosen_files.load()) return files->find(folder, name);
  if (is_there(folder / name)) return folder / name;
  std::string slashes = name;
  std::replace(slashes.begin(), slashes.end(), '\\', '/');
  const std::filesystem::path plain = folder / slashes;
  if (is_there(plain)) return plain;
  const std::filesystem::path decoded = percent_decoded(slashes);
  if (is_there(folder / decoded)) return folder / decoded;
  if (const auto path = path_of_any_case(folder, slashes)) return *path;
  if (decoded.has_parent_path())
    if (const auto path = path_of_any_case(folder, decoded.filename())) return *path;
  return plain;
}

}  // namespace lenticule::render
