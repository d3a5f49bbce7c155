// SPDX-License-Identifier: Apache-2.0
// FollowedRig is the rig for which views are woven during playback. It follows the rig file and its
// trim file, and keeps the last valid rig while they cannot be used.
#pragma once

#include <array>
#include <cstdint>
#include <filesystem>
#include <memory>
#include <mutex>
#include <string>

#include "base/file_mark.h"
#include "optics/rig.h"
#include "player/sources/live_trim.h"

namespace lenticule::player {

/// Thread safety: any thread.
class FollowedRig {
 public:
  /// Reads the rig. A `trim` that could not be saved replaces that of the file. Throws
  /// Error(Input).
  explicit FollowedRig(std::filesystem::path rig_file,
                       std::shared_ptr<const LiveTrim> trim = nullptr);

  /// Checks the files with two stat() calls, and reads them if they were replaced. Files that
  /// cannot be read, or a rig for a panel of another size, change nothing; complaint() returns the
  /// reason.
  void look();
  /// Makes the next look() read the files even if they are unchanged.
  void read_again();

  /// Returns a number that changes whenever the rig changes.
  [[nodiscard]] uint64_t version() const;
  /// Returns the rig with its trim applied.
  [[nodiscard]] optics::Rig rig() const;
  /// Returns the reason why the files are not followed; empty while they are.
  [[nodiscard]] std::string complaint() const;

 private:
  struct Seen {
    std::array<FileMark, 2> files;
    uint64_t trim_version = 0;
    friend bool operator==(const Seen&, const Seen&) = default;
  };
  [[nodiscard]] Seen glance() const;
  [[nodiscard]] optics::Rig read() const;

  const std::filesystem::path rig_file_, trim_file_;
  const std::shared_ptr<const LiveTrim> trim_;
  mutable std::mutex mutex_;  ///< guards the members below
  Seen seen_;
  bool again_ = false;
  optics::Rig rig_;
  uint64_t version_ = 1;
  std::string complaint_;
};

}  // namespace lenticule::player
