// SPDX-License-Identifier: Apache-2.0
// RigStore is the copy of a rig that a service may change, where the rig itself belongs to the
// administrator: /etc/lenticule/lobby.toml and /var/lib/lenticule/rigs/lobby.toml. Trims and
// calibrations made during playback are saved in the copy, and stay in use until the administrator
// edits the rig.
//
// Files: the copy, its trim and its numbered older versions as those of any rig, and "lobby.given",
// the text of the rig and trim that the copy was made from.
#pragma once

#include <array>
#include <filesystem>

#include "base/file.h"
#include "optics/rig.h"

namespace lenticule::optics {

/// Writes the rig to `file` atomically. If `file` exists, its bytes are first copied to
/// "STEM.NUMBER.toml" beside it, with a number above all existing ones, and synchronised. Returns
/// the path of the copy, empty if there was no old file. Throws Error(Input) for a rig that could
/// not be read back or an old file that cannot be read, Error(Failed) if writing fails: then `file`
/// is unchanged and there is no new copy. Two programs may call this at once: no copy overwrites
/// another.
[[nodiscard]] std::filesystem::path save_with_history(const Rig& rig,
                                                      const std::filesystem::path& file);

/// Thread safety: one thread.
class RigStore {
 public:
  /// Reads nothing yet.
  RigStore(std::filesystem::path given, std::filesystem::path copy);

  /// Returns the file to use: the copy if it is valid and was made from the present rig, else the
  /// rig.
  [[nodiscard]] std::filesystem::path in_use() const;

  /// Makes a new copy if the present one is missing, not valid or made from another text; keeps the
  /// old one under a number. Returns true if it made one. Throws Error(Input) if the rig or its
  /// trim is not valid, Error(Failed) if the copy cannot be written; in_use() then returns a file
  /// that is as it was before, or the rig.
  bool update();
  /// Calls update() if the rig or its trim was replaced since the last call.
  bool update_if_edited();

  [[nodiscard]] const std::filesystem::path& given() const { return given_; }
  [[nodiscard]] const std::filesystem::path& copy() const { return copy_; }
  /// Returns true if the copy is in use and differs from the rig: it was calibrated or trimmed.
  [[nodiscard]] bool differs() const;

 private:
  using Marks = std::array<FileMark, 2>;
  [[nodiscard]] Marks glance() const;

  std::filesystem::path given_, copy_, made_from_;
  Marks seen_{};
};

}  // namespace lenticule::optics
