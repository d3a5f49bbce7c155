// SPDX-License-Identifier: Apache-2.0
// The files of the pages are part of the program: its CMakeLists.txt writes them into a source.
#pragma once

#include <span>
#include <string_view>

namespace lenticule::web {

struct PageFile {
  std::string_view name;  ///< "now.html"
  const char* type;       ///< media type
  std::string_view bytes;
  const char* tag;  ///< entity tag, in quotes; differs for each content
};

[[nodiscard]] std::span<const PageFile> page_files();

}  // namespace lenticule::web
