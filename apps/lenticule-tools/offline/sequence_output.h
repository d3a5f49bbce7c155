// SPDX-License-Identifier: Apache-2.0
// open_sequence_output writes rendered or converted frames to a sequence container.
#pragma once

#include <memory>

#include "apps/lenticule-tools/offline/frame_output.h"

namespace lenticule::tools {

/// Returns the metadata of the container that open_sequence_output() writes.
[[nodiscard]] frames::SequenceInfo sequence_info_of(const OutputRequest& request);

/// Returns the FrameOutput of a target that ends in ".lts". Frames must be delivered in order,
/// without those for which has() returns true. The unfinished file is called TARGET.part. Throws
/// the errors of open_output(), and Error(Input) if a file to resume was started with other input.
[[nodiscard]] std::unique_ptr<FrameOutput> open_sequence_output(const OutputRequest& request);

}  // namespace lenticule::tools
