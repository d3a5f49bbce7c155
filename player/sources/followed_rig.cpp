// SPDX-License-Identifier: Apache-2.0
#include "player/sources/followed_rig.h"

#include <fmt/format.h>

#include <exception>
#include <utility>

#include "optics/rig_file.h"
#include "optics/trim.h"

namespace lenticule::player {

FollowedRig::FollowedRig(std::filesystem::path rig_file, std::shared_ptr<const LiveTrim> trim)
    : rig_file_(std::move(rig_file)),
      trim_file_(optics::trim_file_of(rig_file_)),
      trim_(std::move(trim)),
      seen_(glance()),
      rig_(read()) {}

FollowedRig::Seen FollowedRig::glance() const {
  return {.files = {mark_of(rig_file_), mark_of(trim_file_)},
          .trim_version = trim_ ? trim_->version() : 0};
}

optics::Rig FollowedRig::read() const {
  const auto unsaved = trim_ ? trim_->unsaved() : std::nullopt;
  if (!unsaved) return optics::load_trimmed_rig(rig_file_);
  optics::Rig rig = optics::trimmed(optics::load_rig(rig_file_), *unsaved);
  optics::validate_rig(rig, rig_file_.string());
  return rig;
}

void FollowedRig::look() {
  const std::lock_guard lock(mutex_);
  const Seen now = glance();
  if (seen_ == now && !std::exchange(again_, false)) return;
  seen_ = now;
  try {
    optics::Rig rig = read();
    if (rig.panel.width_px != rig_.panel.width_px || rig.panel.height_px != rig_.panel.height_px) {
      complaint_ = fmt::format("{}: is for a panel of {}x{} pixels, not {}x{}", rig_file_.string(),
                               rig.panel.width_px, rig.panel.height_px, rig_.panel.width_px,
                               rig_.panel.height_px);
      return;
    }
    if (rig.panel.mounting != rig_.panel.mounting || rig.panel.bits != rig_.panel.bits) {
      complaint_ =
          fmt::format("{}: has another panel.{}, which a player reads at its start",
                      rig_file_.string(), rig.panel.bits != rig_.panel.bits ? "bits" : "mounting");
      return;
    }
    complaint_.clear();
    if (rig == rig_) return;
    rig_ = std::move(rig);
    ++version_;
  } catch (const std::exception& error) {
    complaint_ = error.what();
  }
}

void FollowedRig::read_again() {
  const std::lock_guard lock(mutex_);
  again_ = true;
}

uint64_t FollowedRig::version() const {
  const std::lock_guard lock(mutex_);
  return version_;
}

optics::Rig FollowedRig::rig() const {
  const std::lock_guard lock(mutex_);
  return rig_;
}

std::string FollowedRig::complaint() const {
  const std::lock_guard lock(mutex_);
  return complaint_;
}

}  // namespace lenticule::player
