// SPDX-License-Identifier: Apache-2.0
// Notices that a rig file, or the trim beside it, was replaced.
#pragma once

#include <array>
#include <filesystem>
#include <optional>
#include <string>

#include "optics/rig.h"

namespace lenticule::player {

/// One thread. Asking costs two stat() calls.
class RigWatch {
 public:
  explicit RigWatch(std::filesystem::path rig_file);

  /// The trimmed rig if either file is another one than at the last call, or at the first. A rig
  /// that cannot be read is none, and complaint() says why.
  [[nodiscard]] std::optional<optics::Rig> changed();
  /// About the last change; empty when all is well.
  [[nodiscard]] const std::string& complaint() const { return complaint_; }

 private:
  struct Mark {
    bool there = false;
    uint64_t inode = 0;
    int64_t size = 0, seconds = 0, nanoseconds = 0;
    friend bool operator==(const Mark&, const Mark&) = default;
  };
  using Marks = std::array<Mark, 2>;
  [[nodiscard]] Marks look() const;

  std::filesystem::path rig_file_, trim_file_;
  std::optional<Marks> seen_;
  std::string complaint_;
};

}  // namespace lenticule::player
