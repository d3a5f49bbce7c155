// SPDX-License-Identifier: Apache-2.0
// Writes small containers for tests, and makes frames of every kind for them.
#pragma once

#include <cstdint>
#include <filesystem>
#include <vector>

#include "frames/frame.h"
#include "frames/sequence/sequence_format.h"

namespace lenticule::test {

enum class Content {
  Noise,   ///< unpredictable
  Flat,    ///< one colour
  Ramp,    ///< a slow change along and across
  Grain,   ///< a slow change with noise of 4 bits, as in photographs
  Lenses,  ///< repeats every 7.7 subpixels, sheared from row to row
};

/// Returns a frame that depends on the arguments only; frames of different numbers differ.
frames::WovenFrame make_frame(frames::FrameGeometry geometry, Content content, int number);

frames::SequenceInfo info_of(frames::FrameGeometry geometry);

/// Writes a finished file of `count` frames of the kind.
void write_sequence(const std::filesystem::path& file, frames::FrameGeometry geometry,
                    Content content, int count);

}  // namespace lenticule::test
