// SPDX-License-Identifier: Apache-2.0
#include "player/sources/live_rig.h"

#include <fmt/format.h>

#include <exception>
#include <utility>

#include "base/error.h"
#include "optics/rig_file.h"

namespace lenticule::player {

LiveRig::LiveRig(std::filesystem::path rig_file, std::string unsavable)
    : rig_file_(std::move(rig_file)),
      trim_file_(optics::trim_file_of(rig_file_)),
      unsavable_(std::move(unsavable)),
      seen_(marks()),
      calibrated_(optics::load_rig(rig_file_)),
      trim_(optics::load_trim(rig_file_)),
      at_start_(trim_) {
  optics::validate_rig(optics::trimmed(calibrated_, trim_), trim_file_.string());
}

optics::Rig LiveRig::rig() const {
  const std::lock_guard lock(mutex_);
  return optics::trimmed(calibrated_, trim_);
}

optics::RigIdentity LiveRig::identity() const {
  const std::lock_guard lock(mutex_);
  return optics::identity_of(calibrated_, trim_);
}

optics::Trim LiveRig::trim() const {
  const std::lock_guard lock(mutex_);
  return trim_;
}

// --- files that other programs replace ------------------------------------------------------

void LiveRig::look() {
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

void LiveRig::read_files() {
  optics::Rig calibrated = optics::load_rig(rig_file_);
  const optics::Trim trim = saved_ ? optics::load_trim(rig_file_) : trim_;
  optics::validate_rig(optics::trimmed(calibrated, trim), trim_file_.string());
  const optics::Panel &theirs = calibrated.panel, &ours = calibrated_.panel;
  const std::string file = rig_file_.string();
  if (theirs.width_px != ours.width_px || theirs.height_px != ours.height_px)
    throw Error(ErrorKind::Input,
                fmt::format("{}: is for a panel of {}x{} pixels, not {}x{}", file, theirs.width_px,
                            theirs.height_px, ours.width_px, ours.height_px));
  if (theirs.mounting != ours.mounting || theirs.bits != ours.bits)
    throw Error(ErrorKind::Input,
                fmt::format("{}: has another panel.{}, which a player reads at its start", file,
                            theirs.bits != ours.bits ? "bits" : "mounting"));
  if (calibrated == calibrated_ && trim == trim_) return;
  set(std::move(calibrated), trim, saved_);
}

void LiveRig::set(optics::Rig calibrated, const optics::Trim& trim, bool saved) {
  const std::lock_guard lock(mutex_);
  saved_ = saved;
  calibrated_ = std::move(calibrated);
  trim_ = trim;
  version_.fetch_add(1, std::memory_order_release);
}

std::string LiveRig::complaint() const {
  const std::lock_guard lock(mutex_);
  return complaint_;
}

// --- changes by this player -----------------------------------------------------------------

optics::Trim LiveRig::trim_after(const KeyPress& press) const {
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

std::string LiveRig::press(const KeyPress& press) {
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

optics::Trim LiveRig::change(const std::function<optics::Trim(const optics::Trim&)>& changed) {
  const std::lock_guard files(files_mutex_);
  const optics::Trim wanted = changed(trim_);
  if (!(wanted == trim_)) use(wanted);
  return trim_;
}

void LiveRig::use(const optics::Trim& wanted) {
  optics::validate_trim(wanted, rig_file_.string());
  optics::validate_rig(optics::trimmed(calibrated_, wanted), rig_file_.string());
  set(calibrated_, wanted, false);
  save();
}

std::filesystem::path LiveRig::replace_rig(const optics::Rig& rig) {
  if (!unsavable_.empty()) throw Error(ErrorKind::Failed, "rig: not saved: " + unsavable_);
  const std::lock_guard files(files_mutex_);
  if (!(rig.panel == calibrated_.panel) || !(rig.identity == calibrated_.identity))
    throw Error(ErrorKind::Input, "rig: is for another panel than the one in use",
                fmt::format("start from the rig of '{}'", calibrated_.name));
  std::filesystem::path kept = optics::save_with_history(rig, rig_file_);
  set(rig, {}, false);
  save();
  return kept;
}

void LiveRig::save() noexcept {
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

void LiveRig::save_again() {
  const std::lock_guard files(files_mutex_);
  if (!saved_ && writes_.due()) save();
}

std::string LiveRig::why_unsaved() const {
  const std::lock_guard lock(mutex_);
  if (saved_) return {};
  if (!unsavable_.empty()) return unsavable_;
  const std::string reason = writes_.state().reason;
  return reason.empty() ? "is being written" : reason;
}

std::string LiveRig::advice() const {
  if (!woven_elsewhere_.load()) return {};
  return "these frames were woven before this trim and do not follow it: render or weave them "
         "again; a player and its renderer use the trim after both are restarted";
}

}  // namespace lenticule::player
