// SPDX-License-Identifier: Apache-2.0
// Text for HTML. Safe from any thread.
#pragma once

#include <string>
#include <string_view>

namespace lenticule::calib {

/// Returns escaped(text) with & < > " ' written so that HTML shows them instead of obeying them.
[[nodiscard]] std::string html_escaped(std::string_view text);

}  // namespace lenticule::calib
