// SPDX-License-Identifier: Apache-2.0
// Rendered or converted frames into a sequence container.
#pragma once

#include <memory>

#include "apps/lenticule/offline/frame_output.h"

namespace lenticule::player {

/// The FrameOutput of a target that ends in ".lts". Frames are delivered in order, those that has()
/// says are there left out. Unfinished, the file is called TARGET.part. Throws what open_output
/// throws, and Error(Input) for a file that is to be resumed and was begun for something else.
[[nodiscard]] std::unique_ptr<FrameOutput> open_sequence_output(const OutputRequest& request);

}  // namespace lenticule::player
