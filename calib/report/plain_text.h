// SPDX-License-Identifier: Apache-2.0
// Escapes text for HTML.
//
// Thread safety: any thread.
#pragma once

#include <string>
#include <string_view>

namespace lenticule::calib {

/// Returns escaped(text) with & < > " ' written as HTML entities.
[[nodiscard]] std::string html_escaped(std::string_view text);

}  // namespace lenticule::calib
