// SPDX-License-Identifier: Apache-2.0
// LiveTrim is the trim of a rig during playback: keys change it, the file beside the rig stores it,
// and all weaving in this process uses it at once.
#pragma once

#include <atomic>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <mutex>
#include <optional>
#include <string>

#include "base/retried_writes.h"
#include "base/terminal_keys.h"
#include "optics/trim.h"

namespace lenticule::player {

/// The change per key press; shift multiplies it by ten, ctrl divides it by ten.
inline constexpr double kTrimOffsetStep = 0.01;  ///< lenses, for left and right
inline constexpr double kTrimPitchStep = 1e-5;   ///< fraction of the pitch, for up and down

/// Thread safety: any thread.
class LiveTrim {
 public:
  /// `unsavable` is the reason if the rig file cannot keep changes; empty if it can. Throws
  /// Error(Input) for the rig file or its trim file.
  explicit LiveTrim(std::filesystem::path rig_file, std::string unsavable = {});

  /// Applies a key press, saves the trim, and returns a sentence about the result; empty for keys
  /// without a function. Escape undoes all presses since the start. Does not throw: an invalid trim
  /// changes nothing, a trim that cannot be saved is used and saved later; the sentence reports
  /// both.
  [[nodiscard]] std::string press(const KeyPress& press);

  /// Applies `changed` to the trim and returns the new trim. Throws Error(Input) and changes
  /// nothing if the result is not a valid trim of this rig.
  optics::Trim change(const std::function<optics::Trim(const optics::Trim&)>& changed);
  [[nodiscard]] optics::Trim trim() const;

  /// Saves a new calibration of the same panel as the rig file, keeps the old file under a number,
  /// and removes the trim, which the new rig contains. Returns the path of the old file's copy.
  /// Throws Error(Input) for a rig of another panel, Error(Failed) if the file cannot be written;
  /// nothing changes then.
  std::filesystem::path replace_rig(const optics::Rig& rig);

  /// Returns the trim if it is not saved yet.
  [[nodiscard]] std::optional<optics::Trim> unsaved() const;
  /// Returns the reason why the trim is not saved; empty if it is.
  [[nodiscard]] std::string why_unsaved() const;
  /// Saves a trim that could not be saved, if another attempt is due.
  void save_again();
  /// Returns the state of the writes.
  [[nodiscard]] RetriedWrites& writes() { return writes_; }
  /// Reads the rig and its trim again after they were replaced. A trim that is not saved yet is
  /// kept; if the files cannot be used, everything is kept.
  void follow_files();

  /// States whether the present content was woven before it came here.
  void note_content(bool woven_elsewhere) { woven_elsewhere_.store(woven_elsewhere); }
  /// Returns what to do for content that a trim does not change; empty for other content.
  [[nodiscard]] std::string advice() const;

  /// Returns the rig with the trim applied.
  [[nodiscard]] optics::Rig rig() const;
  [[nodiscard]] optics::RigIdentity identity() const;
  /// Returns a number that changes with every change.
  [[nodiscard]] uint64_t version() const { return version_.load(std::memory_order_acquire); }

 private:
  void take(const optics::Trim& wanted);
  void save() noexcept;
  [[nodiscard]] optics::Trim after(const KeyPress& press) const;

  std::filesystem::path rig_file_;
  const std::string unsavable_;
  optics::Rig calibrated_;
  optics::Trim at_start_;
  mutable std::mutex mutex_;  ///< guards calibrated_ and the next three members
  optics::Trim trim_;
  bool saved_ = true;
  RetriedWrites writes_;
  std::atomic<uint64_t> version_{1};
  std::atomic<bool> woven_elsewhere_{false};
};

}  // namespace lenticule::player
