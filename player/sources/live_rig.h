// SPDX-License-Identifier: Apache-2.0
// LiveRig is the rig of a player, with its trim. It follows the rig file and the trim file while
// other programs replace them, and keys and programs change its trim. All weaving in this process
// uses the newest one at once.
#pragma once

#include <array>
#include <atomic>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <mutex>
#include <optional>
#include <string>

#include "base/file.h"
#include "base/retried_writes.h"
#include "base/terminal_keys.h"
#include "optics/trim.h"

namespace lenticule::player {

/// The change per key press; shift multiplies it by ten, ctrl divides it by ten.
inline constexpr double kTrimOffsetStep = 0.01;  ///< lenses, for left and right
inline constexpr double kTrimPitchStep = 1e-5;   ///< fraction of the pitch, for up and down

/// Thread safety: any thread.
class LiveRig {
 public:
  /// `unsavable` is the reason if the rig file cannot keep changes; empty if it can. Throws
  /// Error(Input) for the rig file or its trim file.
  explicit LiveRig(std::filesystem::path rig_file, std::string unsavable = {});

  [[nodiscard]] const std::filesystem::path& file() const { return rig_file_; }
  /// Returns the rig with its trim applied.
  [[nodiscard]] optics::Rig rig() const;
  [[nodiscard]] optics::RigIdentity identity() const;
  [[nodiscard]] optics::Trim trim() const;
  /// Returns a number that changes with every change of the rig or its trim.
  [[nodiscard]] uint64_t version() const { return version_.load(std::memory_order_acquire); }

  /// Checks the files with two stat() calls, and reads them if they were replaced. Files that
  /// cannot be read, or a rig for another panel, change nothing; complaint() returns the reason. A
  /// trim that is not saved yet is kept.
  void look();
  /// Makes the next look() read the files even if they are unchanged.
  void read_again() { again_.store(true); }
  /// Returns the reason why the files are not followed; empty while they are.
  [[nodiscard]] std::string complaint() const;

  /// Applies a key press, saves the trim, and returns a sentence about the result; empty for keys
  /// without a function. Escape undoes all presses since the start. Does not throw: an invalid trim
  /// changes nothing, a trim that cannot be saved is used and saved later; the sentence reports
  /// both.
  [[nodiscard]] std::string press(const KeyPress& press);
  /// Applies `changed` to the trim and returns the new trim. Throws Error(Input) and changes
  /// nothing if the result is not a valid trim of this rig.
  optics::Trim change(const std::function<optics::Trim(const optics::Trim&)>& changed);
  /// Saves a new calibration of the same panel as the rig file, keeps the old file under a number,
  /// and removes the trim, which the new rig contains. Returns the path of the old file's copy.
  /// Throws Error(Input) for a rig of another panel, Error(Failed) if the file cannot be written;
  /// nothing changes then.
  std::filesystem::path replace_rig(const optics::Rig& rig);

  /// Returns the reason why the trim is not saved; empty if it is.
  [[nodiscard]] std::string why_unsaved() const;
  /// Saves a trim that could not be saved, if another attempt is due.
  void save_again();
  /// Returns the state of the writes.
  [[nodiscard]] RetriedWrites& writes() { return writes_; }

  /// States whether the present content was woven before it came here.
  void note_content(bool woven_elsewhere) { woven_elsewhere_.store(woven_elsewhere); }
  /// Returns what to do for content that a trim does not change; empty for other content.
  [[nodiscard]] std::string advice() const;

 private:
  /// State of the rig file and the trim file.
  using Marks = std::array<FileMark, 2>;
  [[nodiscard]] Marks marks() const { return {mark_of(rig_file_), mark_of(trim_file_)}; }
  // The functions below are called with files_mutex_ locked.
  void read_files();
  void use(const optics::Trim& wanted);
  void set(optics::Rig calibrated, const optics::Trim& trim, bool saved);
  void save() noexcept;
  [[nodiscard]] optics::Trim trim_after(const KeyPress& press) const;

  const std::filesystem::path rig_file_, trim_file_;
  const std::string unsavable_;
  /// Held while files are read or written, which may take for ever; locked before mutex_. Whoever
  /// holds it may read the members below.
  std::mutex files_mutex_;
  Marks seen_;
  /// Guards the members below, for a few instructions at a time; they change while both are held.
  mutable std::mutex mutex_;
  std::string complaint_;
  optics::Rig calibrated_;  ///< the rig of the file, without trim
  optics::Trim trim_;
  const optics::Trim at_start_;
  bool saved_ = true;
  RetriedWrites writes_;
  std::atomic<bool> again_{false};
  std::atomic<uint64_t> version_{1};
  std::atomic<bool> woven_elsewhere_{false};
};

}  // namespace lenticule::player
