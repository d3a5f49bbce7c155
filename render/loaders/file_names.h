// SPDX-License-Identifier: Apache-2.0
// Finds the files that a scene file names, as other systems write such names.
#pragma once

#include <filesystem>
#include <string>

namespace lenticule::render {

/// Decodes "%20" and similar, as URIs have them.
[[nodiscard]] std::string percent_decoded(const std::string& text);

/// Returns the path of a file that a scene in `folder` names. Tries the name with forward slashes,
/// then percent-decoded, then with letters of another case, and for a name with folders also the
/// file of that name beside the scene. Returns the first of these that exists, else folder / name.
[[nodiscard]] std::filesystem::path named_file(const std::filesystem::path& folder,
                                               const std::string& name);

}  // namespace lenticule::render
