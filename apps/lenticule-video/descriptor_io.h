// SPDX-License-Identifier: Apache-2.0
// Lets FFmpeg read and write an open descriptor instead of a named file.
#pragma once

#include "apps/lenticule-video/av_handles.h"

namespace lenticule::video {

/// Lifetime: the descriptor stays its owner's and must outlive the result. Throws Error(Failed).
[[nodiscard]] AvIo read_descriptor(const int& fd);
[[nodiscard]] AvIo write_descriptor(const int& fd);

}  // namespace lenticule::video
