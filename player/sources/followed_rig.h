// SPDX-License-Identifier: Apache-2.0
// The rig that views are woven for while they play: what its file and the trim beside it say, and
// the last good rig while they cannot be used.
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

/// Any thread.
class FollowedRig {
 public:
  /// Reads the rig. A `trim` that could not be saved stands in for that of the file. Throws
  /// Error(Input).
  explicit FollowedRig(std::filesystem::path rig_file,
                       std::shared_ptr<const LiveTrim> trim = nullptr);

  /// Looks at the files, which costs two stat() calls, and reads them if they were replaced. What
  /// cannot be read, or is for a panel of another size, changes nothing: complaint() says why.
  void look();
  /// Reads the files at the next look() even if they are the same.
  void read_again();

  /// Another number whenever the rig is another one.
  [[nodiscard]] uint64_t version() const;
  /// The trimmed rig.
  [[nodiscard]] optics::Rig rig() const;
  /// Why the files are not followed; empty while they are.
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
  mutable std::mutex mutex_;  ///< guards what follows
  Seen seen_;
  bool again_ = false;
  optics::Rig rig_;
  uint64_t version_ = 1;
  std::string complaint_;
};

}  // namespace lenticule::player
