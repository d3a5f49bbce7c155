// SPDX-License-Identifier: Apache-2.0
// Text from devices and files, made fit for rig files, JSON and HTML. All functions are safe from
// any thread.
#pragma once

#include <cstddef>
#include <string>
#include <string_view>

namespace lenticule::calib {

/// Printable UTF-8 on one line: tabs and line ends become blanks, other control characters and
/// bytes that are not UTF-8 become question marks.
[[nodiscard]] std::string printable(std::string_view text);

/// At most `bytes` long; what is longer ends in "..." after a whole character. `text` must be
/// UTF-8 and `bytes` 3 at least.
[[nodiscard]] std::string clipped(std::string text, size_t bytes);

/// printable(text) with & < > " ' written so that HTML shows them instead of obeying them.
[[nodiscard]] std::string html_escaped(std::string_view text);

}  // namespace lenticule::calib
