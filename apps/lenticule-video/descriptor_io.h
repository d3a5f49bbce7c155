// SPDX-License-Identifier: Apache-2.0
// FFmpeg's reading and writing over a descriptor that is open already: it never sees a name.
#pragma once

#include "apps/lenticule-video/av_handles.h"

namespace lenticule::video {

/// The descriptor stays its owner's and must outlive the result. Throws Error(Failed).
[[nodiscard]] AvIo read_descriptor(const int& fd);
[[nodiscard]] AvIo write_descriptor(const int& fd);

}  // namespace lenticule::video
