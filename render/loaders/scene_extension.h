// SPDX-License-Identifier: Apache-2.0
// File name extension of a scene, which selects its loader.
#pragma once

#include <algorithm>
#include <filesystem>
#include <string>

namespace lenticule::render {

/// Returns the extension in lower case, with the dot; empty if there is none.
[[nodiscard]] inline std::string extension_of(const std::filesystem::path& file) {
  std::string extension = file.extension().string();
  std::transform(extension.begin(), extension.end(), extension.begin(), [](char c) {
    return c >= 'A' && c <= 'Z' ? static_cast<char>(c - 'A' + 'a') : c;
  });
  return extension;
}

}  // namespace lenticule::render
