// SPDX-License-Identifier: Apache-2.0
// LiveRig is the rig of a player, with its trim. It follows the rig file and the trim file while
// other programs replace them, and keys and programs change its trim. All weaving in this process
// uses the newest one at once.
#pragma once

#include <fmt/format.h>

#include <array>
#include <atomic>
#include <cstdint>
#include <exception>
#include <filesystem>
#include <functional>
#include <mutex>
#include <string>
#include <utility>

#include "base/error_kinds.h"
#include "base/file.h"
#include "base/retried_writes.h"
#include "base/terminal_keys.h"
#include "optics/rig_file.h"
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
  explicit LiveRig(std::filesystem::path rig_file, std::string unsavable = {})
      : rig_file_(std::move(rig_file)),
        trim_file_(optics::trim_file_of(rig_file_)),
        unsavable_(std::move(unsavable)),
        seen_(marks()),
        calibrated_(optics::load_rig(rig_file_)),
        trim_(optics::load_trim(rig_file_)),
        at_start_(trim_) {
    optics::validate_rig(optics::trimmed(calibrated_, trim_), trim_file_.string());
  }

  [[nodiscard]] const std::filesystem::path& file() const { return rig_file_; }
  /// Returns the rig with its trim applied.
  [[nodiscard]] optics::Rig rig() const {
    const std::lock_guard lock(mutex_);
    return optics::trimmed(calibrated_, trim_);
  }
  [[nodiscard]] optics::RigIdentity identity() const {
    const std::lock_guard lock(mutex_);
    return optics::identity_of(calibrated_, trim_);
  }
  [[nodiscard]] optics::Trim trim() const {
    const std::lock_guard lock(mutex_);
    return trim_;
  }
  /// Returns a number that changes with every change of the rig or its trim.
  [[nodiscard]] uint64_t version() const { return version_.load(std::memory_order_acquire); }

  /// Checks the files with two stat() calls, and reads them if they were replaced. Files that
  /// cannot be read, or a rig for another panel, change nothing; complaint() returns the reason. A
  /// trim that is not saved yet is kept.
  void look() {
    const std::lock_guard files(files_mutex_);
    const Marks now = marks();
    if (!again_.exchange(false) && seen_ == now) return;
    seen_ = now;
    std::string complaint;
    try {
      read_files();
    } catch (const std::exception& error) {
      complaint = error.what();
    }
    const std::lock_guard lock(mutex_);
    complaint_ = std::move(complaint);
  }
  /// Makes the next look() read the files even if they are unchanged.
  void read_again() { again_.store(true); }
  /// Returns the reason why the files are not followed; empty while they are.
  [[nodiscard]] std::string complaint() const {
    const std::lock_guard lock(mutex_);
    return complaint_;
  }

  /// Applies a key press, saves the trim, and returns a sentence about the result; empty for keys
  /// without a function. Escape undoes all presses since the start. Does not throw: an invalid trim
  /// changes nothing, a trim that cannot be saved is used and saved later; the sentence reports
  /// both.
  [[nodiscard]] std::string press(const KeyPress& press) {
    const std::lock_guard files(files_mutex_);
    const optics::Trim wanted = trim_after(press);
    if (wanted == trim_) return {};
    try {
      use(wanted);
    } catch (const std::exception& error) {
      return fmt::format("the trim is unchanged: {}", error.what());
    }
    const std::string numbers = fmt::format("trim: offset {:+.3f} lenses, pitch {:+.1e}",
                                            wanted.offset.value, wanted.pitch_relative);
    if (!saved_) return fmt::format("{}, not saved yet: {}", numbers, why_unsaved());
    return fmt::format("{}, in {}", numbers, trim_file_.string());
  }
  /// Applies `changed` to the trim and returns the new trim. Throws Error(Input) and changes
  /// nothing if the result is not a valid trim of this rig.
  optics::Trim change(const std::function<optics::Trim(const optics::Trim&)>& changed) {
    const std::lock_guard files(files_mutex_);
    const optics::Trim wanted = changed(trim_);
    if (!(wanted == trim_)) use(wanted);
    return trim_;
  }
  /// Saves a new calibration of the same panel as the rig file, keeps the old file under a number,
  /// and removes the trim, which the new rig contains. Returns the path of the old file's copy.
  /// Throws Error(Input) for a rig of another panel, Error(Failed) if the file cannot be written;
  /// nothing changes then.
  std::filesystem::path replace_rig(const optics::Rig& rig) {
    if (!unsavable_.empty()) throw failed_error("rig: not saved: {}", unsavable_);
    const std::lock_guard files(files_mutex_);
    if (!(rig.panel == calibrated_.panel) || !(rig.identity == calibrated_.identity))
      throw Error(ErrorKind::Input, "rig: is for another panel than the one in use",
                  fmt::format("start from the rig of '{}'", calibrated_.name));
    std::filesystem::path kept = optics::save_with_history(rig, rig_file_);
    set(rig, {}, false);
    save();
    return kept;
  }

  /// Returns the reason why the trim is not saved; empty if it is.
  [[nodiscard]] std::string why_unsaved() const {
    const std::lock_guard lock(mutex_);
    if (saved_) return {};
    if (!unsavable_.empty()) return unsavable_;
    const std::string reason = writes_.state().reason;
    return reason.empty() ? "is being written" : reason;
  }
  /// Saves a trim that could not be saved, if another attempt is due.
  void save_again() {
    const std::lock_guard files(files_mutex_);
    if (!saved_ && writes_.due()) save();
  }
  /// Returns the state of the writes.
  [[nodiscard]] RetriedWrites& writes() { return writes_; }

  /// States whether the present content was woven before it came here.
  void note_content(bool woven_elsewhere) { woven_elsewhere_.store(woven_elsewhere); }
  /// Returns what to do for content that a trim does not change; empty for other content.
  [[nodiscard]] std::string advice() const {
    if (!woven_elsewhere_.load()) return {};
    return "these frames were woven before this trim and do not follow it: render or weave them "
           "again; a player and its renderer use the trim after both are restarted";
  }

 private:
  /// State of the rig file and the trim file.
  using Marks = std::array<FileMark, 2>;
  [[nodiscard]] Marks marks() const { return {mark_of(rig_file_), mark_of(trim_file_)}; }
  // The functions below are called with files_mutex_ locked.
  void read_files() {
    optics::Rig calibrated = optics::load_rig(rig_file_);
    const optics::Trim trim = saved_ ? optics::load_trim(rig_file_) : trim_;
    optics::validate_rig(optics::trimmed(calibrated, trim), trim_file_.string());
    const optics::Panel &theirs = calibrated.panel, &ours = calibrated_.panel;
    const std::string file = rig_file_.string();
    if (theirs.width_px != ours.width_px || theirs.height_px != ours.height_px)
      throw input_error("{}: is for a panel of {}x{} pixels, not {}x{}", file, theirs.width_px,
                        theirs.height_px, ours.width_px, ours.height_px);
    if (theirs.mounting != ours.mounting || theirs.bits != ours.bits)
      throw input_error("{}: has another panel.{}, which a player reads at its start", file,
                        theirs.bits != ours.bits ? "bits" : "mounting");
    if (calibrated == calibrated_ && trim == trim_) return;
    set(std::move(calibrated), trim, saved_);
  }
  void use(const optics::Trim& wanted) {
    optics::validate_trim(wanted, rig_file_.string());
    optics::validate_rig(optics::trimmed(calibrated_, wanted), rig_file_.string());
    set(calibrated_, wanted, false);
    save();
  }
  void set(optics::Rig calibrated, const optics::Trim& trim, bool saved) {
    const std::lock_guard lock(mutex_);
    saved_ = saved;
    calibrated_ = std::move(calibrated);
    trim_ = trim;
    version_.fetch_add(1, std::memory_order_release);
  }
  void save() noexcept {
    bool saved = false;
    if (unsavable_.empty()) {
      try {
        optics::save_trim(trim_, rig_file_);
        saved = true;
        writes_.succeeded();
      } catch (const std::exception& error) {
        writes_.failed(error.what());
      }
    }
    const std::lock_guard lock(mutex_);
    saved_ = saved;
  }
  [[nodiscard]] optics::Trim trim_after(const KeyPress& press) const {
    const double stride = press.stride == Stride::Coarse ? 10.0
                          : press.stride == Stride::Fine ? 0.1
                                                         : 1.0;
    switch (press.key) {
      case Key::Left:
        return optics::changed_by(trim_, -stride * kTrimOffsetStep, 0.0);
      case Key::Right:
        return optics::changed_by(trim_, stride * kTrimOffsetStep, 0.0);
      case Key::Up:
        return optics::changed_by(trim_, 0.0, stride * kTrimPitchStep);
      case Key::Down:
        return optics::changed_by(trim_, 0.0, -stride * kTrimPitchStep);
      case Key::Restore:
        return at_start_;
      default:
        return trim_;
    }
  }

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
