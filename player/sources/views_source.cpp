// SPDX-License-Identifier: Apache-2.0
#include "player/sources/views_source.h"

#include <utility>

#include "frames/charts/charts.h"

namespace lenticule::player {

ViewsSource::ViewsSource(std::shared_ptr<const LiveTrim> trim) : trim_(std::move(trim)) {
  weave();
}

void ViewsSource::weave() {
  version_ = trim_->version();
  newest_ = std::make_shared<const frames::WovenFrame>(
      frames::draw_chart({.pattern = frames::ChartPattern::NumberedViews, .rig = trim_->rig()}));
}

frames::PullStatus ViewsSource::pull(frames::AcquiredFrame& out) {
  if (pulled_) return frames::PullStatus::End;
  if (version_ != trim_->version()) weave();
  pulled_ = true;
  acquired_[next_token_] = newest_;
  out = {.frame = newest_->view(), .number = 0, .token = next_token_++};
  return frames::PullStatus::Ready;
}

bool ViewsSource::rewind() {
  return std::exchange(pulled_, false);
}

}  // namespace lenticule::player
