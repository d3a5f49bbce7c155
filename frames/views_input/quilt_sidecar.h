// SPDX-License-Identifier: Apache-2.0
// The JSON file beside a quilt or a picture with depth, as tools for Looking Glass displays and
// their users write it, in the spellings that are about.
#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <string_view>

#include "frames/views_input/content_name.h"

namespace lenticule::frames {

inline constexpr size_t kMaxSidecarBytes = size_t{1} << 20;

struct QuiltSidecar {
  /// Both or neither.
  std::optional<int> columns, rows;
  std::optional<int> views;
  std::optional<double> aspect;
  bool inverted = false;  ///< the first view is the rightmost camera's
  std::optional<DepthPlace> depth;
  bool black_is_near = false;
  double depthiness = 1.0;  ///< factor of the usual disparities
};

/// docs/content.md lists the keys. Empty for JSON that has none of them: it is about something
/// else. Throws Error(Input) "source: key: cause" for what is not JSON and for values that make no
/// sense.
[[nodiscard]] std::optional<QuiltSidecar> parse_quilt_sidecar(std::string_view json,
                                                              const std::string& source);

/// "city.json" of "city.png".
[[nodiscard]] std::filesystem::path sidecar_of(const std::filesystem::path& picture);

/// Empty if there is none. Throws as parsing does, and for a file that cannot be read.
[[nodiscard]] std::optional<QuiltSidecar> read_sidecar_of(const std::filesystem::path& picture);

}  // namespace lenticule::frames
