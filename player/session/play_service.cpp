// SPDX-License-Identifier: Apache-2.0
#include "player/session/play_service.h"

#include <fmt/format.h>

#include <optional>

#include "player/session/stored_output.h"

namespace lenticule::player {

ProgressSample progress_sample(const PlayReport& report, const display::KmsStatistics* kms) {
  StageDelays own = report.delays;
  if (own.source_waits_for_others) own.source = 0;
  ProgressSample sample{.flips = report.pace.shown,
                        .vblanks = report.wake.count,
                        .failures = report.flip_timeouts + report.busy,
                        .panel_away = report.off,
                        .stalled = !stalled_stage(own).empty()};
  if (kms == nullptr) return sample;
  sample.flips = kms->flips;
  sample.failures += kms->busy + kms->refused + kms->flip_timeouts;
  sample.panel_away |= kms->panel != display::PanelState::Showing;
  return sample;
}

std::string status_text(const PlayReport& report, const display::KmsStatistics* kms,
                        const display::ExactnessReport* exactness) {
  std::string text;
  if (exactness != nullptr) text = exactness->summary() + "; ";
  text += fmt::format("{} frames shown, {} underruns, {} missed vblanks", report.pace.shown,
                      report.pace.underruns, report.pace.missed);
  if (report.off) text += ", output off";
  if (kms != nullptr) text += fmt::format(", panel {}", panel_state_name(kms->panel));
  return text + "; " + report.display;
}

PlayService::PlayService(const ServiceManager& manager, const display::KmsDisplay* display)
    : manager_(manager), display_(display), last_ping_(std::chrono::steady_clock::now()) {
  store_again();
}

void PlayService::store_again() {
  if (display_ != nullptr) store_output(manager_, *display_);
}

void PlayService::report(const PlayReport& report) {
  if (!manager_.present()) return;
  std::optional<display::KmsStatistics> kms;
  std::optional<display::ExactnessReport> exactness;
  if (display_ != nullptr) {
    kms = display_->statistics();
    exactness = display_->exactness();
  }
  const display::KmsStatistics* const statistics = kms ? &*kms : nullptr;
  std::string text = status_text(report, statistics, exactness ? &*exactness : nullptr);
  if (!problem_.empty()) text = "test card shown: " + problem_ + "; " + text;
  if (!warning_.empty()) text += "; " + warning_;
  if (!ready_ && report.first_frame_ms > 0) {
    ready_ = true;
    manager_.ready(text);
  } else if (ready_) {
    manager_.status(text);
  }

  if (!manager_.watchdog()) return;
  // Often enough for the watchdog, and rarely enough that a failing display is noticed between two
  // pings.
  const auto now = std::chrono::steady_clock::now();
  if (now - last_ping_ < *manager_.watchdog() * 2 / 5) return;
  last_ping_ = now;
  if (watchdog_.should_ping(progress_sample(report, statistics))) manager_.ping();
}

}  // namespace lenticule::player
