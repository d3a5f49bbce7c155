// SPDX-License-Identifier: Apache-2.0
// Reads and writes rig files: TOML that people edit. docs/panel/optics.md has the list of keys.
#pragma once

#include <array>
#include <filesystem>
#include <string>
#include <string_view>

#include "base/file.h"
#include "optics/rig.h"

namespace lenticule::optics {

/// Parses and validates a rig. Every failure (syntax, unknown key, wrong type, value out of range)
/// is an Error(Input) that starts with "source:line:". The error for an unknown key names the most
/// similar known key.
[[nodiscard]] Rig parse_rig(std::string_view toml, const std::string& source);

/// Parses a file as parse_rig() does. Throws Error(Input) also for a file that cannot be read or is
/// larger than 16 MiB.
[[nodiscard]] Rig load_rig(const std::filesystem::path& file);

/// Returns the file's text; parse_rig() restores the same rig from the text, bit for bit.
[[nodiscard]] std::string rig_to_toml(const Rig& rig);

/// Writes the rig atomically (temporary name, then rename). Throws Error(Failed).
void save_rig(const Rig& rig, const std::filesystem::path& file);

// RigStore is the copy of a rig that a service may change, where the rig itself belongs to the
// administrator: /etc/lenticule/lobby.toml and /var/lib/lenticule/rigs/lobby.toml. Trims and
// calibrations made during playback are saved in the copy, and stay in use until the administrator
// edits the rig.
//
// Files: the copy, its trim and its numbered older versions as those of any rig, and "lobby.given",
// the text of the rig and trim that the copy was made from.

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
