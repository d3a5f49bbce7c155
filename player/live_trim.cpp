// SPDX-License-Identifier: Apache-2.0
#include "player/live_trim.h"

#include <fmt/format.h>

#include <utility>

#include "base/error.h"
#include "optics/rig_file.h"

namespace lenticule::player {

using calib::Key;
using calib::KeyPress;
using calib::Stride;

LiveTrim::LiveTrim(std::filesystem::path rig_file)
    : rig_file_(std::move(rig_file)),
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
    return fmt::format("the trim stays: {}", error.what());
  }
  return fmt::format("trim: offset {:+.3f} lenses, pitch {:+.1e}, in {}", wanted.offset.value,
                     wanted.pitch_relative, optics::trim_file_of(rig_file_).string());
}

/// Under the lock.
void LiveTrim::take(const optics::Trim& wanted) {
  optics::validate_trim(wanted, rig_file_.string());
  optics::validate_rig(optics::trimmed(calibrated_, wanted), rig_file_.string());
  optics::save_trim(wanted, rig_file_);
  trim_ = wanted;
  version_.fetch_add(1, std::memory_order_release);
}

optics::Trim LiveTrim::change(const std::function<optics::Trim(const optics::Trim&)>& changed) {
  const std::lock_guard lock(mutex_);
  const optics::Trim wanted = changed(trim_);
  if (!(wanted == trim_)) take(wanted);
  return trim_;
}

optics::Trim LiveTrim::trim() const {
  const std::lock_guard lock(mutex_);
  return trim_;
}

optics::Rig LiveTrim::rig() const {
  const std::lock_guard lock(mutex_);
  return optics::trimmed(calibrated_, trim_);
}

}  // namespace lenticule::player
