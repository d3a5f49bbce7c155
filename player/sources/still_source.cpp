// SPDX-License-Identifier: Apache-2.0
#include "player/sources/still_source.h"

#include "frames/charts/charts.h"

namespace lenticule::player {

StillSource::StillSource(frames::WovenFrame frame)
    : newest_(std::make_shared<const frames::WovenFrame>(std::move(frame))) {}

StillSource::StillSource(std::shared_ptr<const LiveRig> rig) : rig_(std::move(rig)) {
  weave_views();
}

void StillSource::weave_views() {
  version_ = rig_->version();
  newest_ = std::make_shared<const frames::WovenFrame>(
      frames::draw_chart({.pattern = frames::ChartPattern::NumberedViews, .rig = rig_->rig()}));
}

frames::PullStatus StillSource::pull(frames::AcquiredFrame& out) {
  if (pulled_) return frames::PullStatus::End;
  if (rig_ && version_ != rig_->version()) weave_views();
  pulled_ = true;
  acquired_[next_token_] = newest_;
  out = {.frame = newest_->view(), .number = 0, .token = next_token_++};
  return frames::PullStatus::Ready;
}

}  // namespace lenticule::player
