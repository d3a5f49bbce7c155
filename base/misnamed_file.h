// SPDX-License-Identifier: Apache-2.0
// Recognises by first bytes or name what people take for a picture, a film or a model by mistake.
#pragma once

#include <optional>
#include <string>
#include <string_view>

namespace lenticule {

struct MisnamedFile {
  std::string_view what;    ///< "a page of the web"
  std::string_view remedy;  ///< "download the file itself"
};

/// Returns what a file is whose first bytes are `head`, or whose name ends in `extension` (in lower
/// case, with its dot); nothing for what it does not know. 64 bytes are enough.
///
/// Thread safety: any thread.
[[nodiscard]] std::optional<MisnamedFile> recognise_misnamed(std::string_view head,
                                                             std::string_view extension);

/// Throws Error(Input) if the file is one of these, or a text. Call it for a file that is binary if
/// it is what its name says, and cannot be read.
void refuse_misnamed(int file, const std::string& name);

}  // namespace lenticule
