// SPDX-License-Identifier: Apache-2.0
// Reads the JSON file beside a quilt or a picture with depth, as tools for Looking Glass displays
// and their users write it, in the spellings in use.
#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <string_view>

#include "frames/views_input/content_name.h"

namespace lenticule::frames {

inline constexpr size_t kMaxSidecarBytes = size_t{1} << 20;

struct QuiltSidecar {
  /// Both are set, or neither.
  std::optional<int> columns, rows;
  std::optional<int> views;
  std::optional<double> aspect;
  bool inverted = false;  ///< the first view is the rightmost camera's
  std::optional<DepthPlace> depth;
  bool black_is_near = false;
  double depthiness = 1.0;  ///< factor of the default disparities
};

/// Parses the JSON; docs/content/content.md lists the keys. Returns nothing for JSON without any of
/// these keys, which has another purpose. Throws Error(Input) "source: key: cause" for invalid JSON
/// and for invalid values.
[[nodiscard]] std::optional<QuiltSidecar> parse_quilt_sidecar(std::string_view json,
                                                              const std::string& source);

/// Returns "city.json" for "city.png".
[[nodiscard]] std::filesystem::path sidecar_of(const std::filesystem::path& picture);

/// Reads the file beside `picture`; returns nothing if there is none. Throws the errors of
/// parse_quilt_sidecar(), also for a file that cannot be read.
[[nodiscard]] std::optional<QuiltSidecar> read_sidecar_of(const std::filesystem::path& picture);

}  // namespace lenticule::frames
