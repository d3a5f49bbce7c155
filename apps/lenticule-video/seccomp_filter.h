// SPDX-License-Identifier: Apache-2.0
// The system calls that a decoder is left with, as a classic BPF program.
#pragma once

#include <linux/filter.h>

#include <vector>

namespace lenticule::video {

/// Calls that are not on the list fail with EPERM, those of a foreign architecture kill. Signals to
/// anybody, opening, connecting, executing, changing identity or scheduling and executable memory
/// are not on the list.
[[nodiscard]] std::vector<sock_filter> decoder_filter();

}  // namespace lenticule::video
