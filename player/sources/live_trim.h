// SPDX-License-Identifier: Apache-2.0
// The trim of a rig while its panel is playing: keys change it, the file beside the rig keeps it,
// and whoever weaves in this process takes it at once.
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

/// What one press changes; shift is ten times as much, ctrl a tenth.
inline constexpr double kTrimOffsetStep = 0.01;  ///< lenses, with left and right
inline constexpr double kTrimPitchStep = 1e-5;   ///< part of the pitch, with up and down

/// Safe from any thread.
class LiveTrim {
 public:
  /// Throws Error(Input) for the rig file or the trim beside it.
  explicit LiveTrim(std::filesystem::path rig_file);

  /// Changes the trim, saves it, and says in one sentence what came of it. Escape takes back all
  /// presses since the start. Empty for keys that mean nothing here. Does not throw: what is no
  /// trim changes nothing, what cannot be saved holds for now and is saved later, and both are
  /// said.
  [[nodiscard]] std::string press(const KeyPress& press);

  /// The same by numbers; returns what the trim is then. Throws Error(Input) for what is no trim of
  /// this rig; nothing is changed then.
  optics::Trim change(const std::function<optics::Trim(const optics::Trim&)>& changed);
  [[nodiscard]] optics::Trim trim() const;

  /// The trim as long as it could not be saved.
  [[nodiscard]] std::optional<optics::Trim> unsaved() const;
  /// Saves what could not be saved, if it is time to try again.
  void save_again();
  /// How saving goes.
  [[nodiscard]] RetriedWrites& writes() { return writes_; }
  /// Reads the rig and its trim again: somebody replaced them. A trim that is not saved yet stays,
  /// and so does everything where the files cannot be used.
  void follow_files();

  /// With the trim in it.
  [[nodiscard]] optics::Rig rig() const;
  [[nodiscard]] optics::RigIdentity identity() const;
  /// Another number after every change.
  [[nodiscard]] uint64_t version() const { return version_.load(std::memory_order_acquire); }

 private:
  void take(const optics::Trim& wanted);
  void save() noexcept;
  [[nodiscard]] optics::Trim after(const KeyPress& press) const;

  std::filesystem::path rig_file_;
  optics::Rig calibrated_;
  optics::Trim at_start_;
  mutable std::mutex mutex_;  ///< guards calibrated_ and the next three
  optics::Trim trim_;
  bool saved_ = true;
  RetriedWrites writes_;
  std::atomic<uint64_t> version_{1};
};

}  // namespace lenticule::player
