// SPDX-License-Identifier: Apache-2.0
// Writes films in containers for tests of players, without other programs.
#pragma once

#include <algorithm>
#include <string>

#include "frames/sequence/sequence_format.h"
#include "frames/sequence/sequence_writer.h"
#include "optics/trim.h"

namespace lenticule::test {

/// Writes a film of `frames` frames, woven for the rig in the file `rig`. All pixels of frame k
/// have the value level + k.
inline void write_sequence(const std::string& file, const std::string& rig, uint8_t level,
                           int frames = 6) {
  const auto loaded = optics::load_rig_and_identity(rig);
  const optics::Panel& panel = loaded.rig.panel;
  frames::SequenceInfo info{.geometry = {.width = panel.width_px, .height = panel.height_px},
                            .rate = {60, 1}};
  frames::state_rig(info, loaded.identity);
  frames::SequenceWriter writer(file, info, {.threads = 1});
  frames::WovenFrame frame(info.geometry);
  for (int k = 0; k < frames; ++k) {
    std::fill(frame.bytes().begin(), frame.bytes().end(), static_cast<uint8_t>(level + k));
    writer.append(frame.view());
  }
  writer.finish();
}

}  // namespace lenticule::test
