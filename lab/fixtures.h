// SPDX-License-Identifier: Apache-2.0
// The rigs that benchmarks measure with, and the folder for their files.
#pragma once

#include <string>

#include "base/temporary.h"
#include "optics/rig.h"

namespace lenticule::lab {

/// Returns the default rig of benchmarks: the 4K kiosk of the sample rigs.
[[nodiscard]] optics::Rig kiosk_rig();
/// Returns the classic integral image of the sample rigs: 64 upright lenses of eight whole pixels.
[[nodiscard]] optics::Rig paper_rig();
/// Returns a rig with a panel of the same size whose pixels are `factor` times as wide and high,
/// with lenses of as many subpixels on a proportionally thicker sheet, so that the viewing zones
/// are equal. Factor 1 returns the same rig.
[[nodiscard]] optics::Rig coarser_rig(const optics::Rig& rig, int factor);
/// Loads `file`, or returns kiosk_rig() if it is empty.
[[nodiscard]] optics::Rig bench_rig(const std::string& file);

/// ScratchFolder is a temporary folder that its destructor removes. Throws Error(Failed).
class ScratchFolder {
 public:
  ScratchFolder();
  [[nodiscard]] std::string file(const std::string& name) const {
    return (folder_.path() / name).string();
  }
  /// Returns a place for the socket of a ring, in a folder of its own: a player locks the folder
  /// of its socket, and this folder is locked already. Throws Error(Failed).
  [[nodiscard]] std::string ring_socket() const;

 private:
  TemporaryFolder folder_;
};
}  // namespace lenticule::lab
