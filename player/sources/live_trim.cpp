// SPDX-License-Identifier: Apache-2.0
#include "player/sources/live_trim.h"

#include <fmt/format.h>

#include <utility>

#include "base/error.h"
#include "optics/rig_file.h"
#include "optics/rig_history.h"

namespace lenticule::player {

LiveTrim::LiveTrim(std::filesystem::path rig_file, std::string unsavable)
    : rig_file_(std::move(rig_file)),
      unsavable_(std::move(unsavable)),
      calibrated_(optics::load_rig(rig_file_)),
      at_start_(optics::load_trim(rig_file_)),
      trim_(at_start_) {
  optics::validate_rig(optics::trimmed(calibrated_, trim_),
                       optics::trim_file_of(rig_file_).string());
}

optics::Trim LiveTrim::after(const KeyPress& press) const {
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

std::string LiveTrim::press(const KeyPress& press) {
  const std::lock_guard lock(mutex_);
  const optics::Trim wanted = after(press);
  if (wanted == trim_) return {};
  try {
    take(wanted);
  } catch (const std::exception& error) {
    return fmt::format("the trim is unchanged: {}", error.what());
  }
  const std::string numbers = fmt::format("trim: offset {:+.3f} lenses, pitch {:+.1e}",
                                          wanted.offset.value, wanted.pitch_relative);
  if (!saved_) return fmt::format("{}, not saved yet: {}", numbers, writes_.state().reason);
  return fmt::format("{}, in {}", numbers, optics::trim_file_of(rig_file_).string());
}

/// Call with the lock held.
void LiveTrim::take(const optics::Trim& wanted) {
  optics::validate_trim(wanted, rig_file_.string());
  optics::validate_rig(optics::trimmed(calibrated_, wanted), rig_file_.string());
  trim_ = wanted;
  save();
  version_.fetch_add(1, std::memory_order_release);
}

/// Call with the lock held.
void LiveTrim::save() noexcept {
  saved_ = false;
  if (!unsavable_.empty()) return;
  try {
    optics::save_trim(trim_, rig_file_);
    saved_ = true;
    writes_.succeeded();
  } catch (const std::exception& error) {
    writes_.failed(error.what());
  }
}

void LiveTrim::save_again() {
  const std::lock_guard lock(mutex_);
  if (!saved_ && writes_.due()) save();
}

std::optional<optics::Trim> LiveTrim::unsaved() const {
  const std::lock_guard lock(mutex_);
  return saved_ ? std::nullopt : std::optional(trim_);
}

std::string LiveTrim::why_unsaved() const {
  const std::lock_guard lock(mutex_);
  if (saved_) return {};
  return unsavable_.empty() ? writes_.state().reason : unsavable_;
}

void LiveTrim::follow_files() {
  const std::lock_guard lock(mutex_);
  try {
    optics::Rig calibrated = optics::load_rig(rig_file_);
    const optics::Trim trim = saved_ ? optics::load_trim(rig_file_) : trim_;
    const bool same_panel = calibrated.panel.width_px == calibrated_.panel.width_px &&
                            calibrated.panel.height_px == calibrated_.panel.height_px;
    if (!same_panel || (calibrated == calibrated_ && trim == trim_)) return;
    optics::validate_rig(optics::trimmed(calibrated, trim), rig_file_.string());
    calibrated_ = std::move(calibrated);
    trim_ = trim;
    version_.fetch_add(1, std::memory_order_release);
  } catch (const std::exception&) {
    return;  // FollowedRig reports the reason.
  }
}

optics::Trim LiveTrim::change(const std::function<optics::Trim(const optics::Trim&)>& changed) {
  const std::lock_guard lock(mutex_);
  const optics::Trim wanted = changed(trim_);
  if (!(wanted == trim_)) take(wanted);
  return trim_;
}

std::filesystem::path LiveTrim::replace_rig(const optics::Rig& rig) {
  if (!unsavable_.empty()) throw Error(ErrorKind::Failed, "rig: not saved: " + unsavable_);
  const std::lock_guard lock(mutex_);
  if (!(rig.panel == calibrated_.panel) || !(rig.identity == calibrated_.identity))
    throw Error(ErrorKind::Input, "rig: is for another panel than the one in use",
                fmt::format("start from the rig of '{}'", calibrated_.name));
  std::filesystem::path kept = optics::save_with_history(rig, rig_file_);
  calibrated_ = rig;
  trim_ = {};
  save();
  version_.fetch_add(1, std::memory_order_release);
  return kept;
}

optics::Trim LiveTrim::trim() const {
  const std::lock_guard lock(mutex_);
  return trim_;
}

optics::RigIdentity LiveTrim::identity() const {
  const std::lock_guard lock(mutex_);
  return optics::identity_of(calibrated_, trim_);
}

std::string LiveTrim::advice() const {
  if (!woven_elsewhere_.load()) return {};
  return "these frames were woven before this trim and do not follow it: render or weave them "
         "again; a player and its renderer use the trim after both are restarted";
}

optics::Rig LiveTrim::rig() const {
  const std::lock_guard lock(mutex_);
  return optics::trimmed(calibrated_, trim_);
}

}  // namespace lenticule::player
