// SPDX-License-Identifier: Apache-2.0
#include "player/session/panel_card.h"

#include <algorithm>
#include <utility>

#include "base/error.h"

namespace lenticule::player {
namespace {

using display::Nanoseconds;

constexpr Nanoseconds kTimeout = std::chrono::seconds(5);
/// Longest time between two checks for hotplug events.
constexpr Nanoseconds kNap = std::chrono::milliseconds(500);

/// Returns the mode that the panel itself prefers; null if none can show a frame pixel for pixel.
const display::ModeInfo* own_mode(const display::PanelInfo& panel) {
  const display::ModeInfo* best = nullptr;
  for (const display::ModeInfo& mode : panel.modes)
    if (mode.usable && (best == nullptr || (mode.preferred && !best->preferred))) best = &mode;
  return best;
}

}  // namespace

bool PanelCard::show(const display::PanelInfo& panel, const display::CardText& text) {
  const display::ModeInfo* const mode = own_mode(panel);
  if (mode == nullptr) return false;
  const frames::FrameGeometry geometry{mode->width, mode->height};
  try {
    if (!shows_on(panel, geometry, mode->refresh)) open(panel, geometry, mode->refresh);
    frames::WovenFrame frame = draw_test_card(geometry, text);
    if (frame == frame_) return true;
    if (sink_->show(frame.view(), kTimeout) != frames::ShowResult::Shown) {
      close();
      return false;
    }
    frame_ = std::move(frame);
    return true;
  } catch (const Error&) {  // Busy, forbidden or gone: the caller tries again.
    close();
    return false;
  }
}

/// Returns true if the card is shown on that panel. Compares the refresh too: another panel on the
/// same connector may have the same size with other timings.
bool PanelCard::shows_on(const display::PanelInfo& panel, const frames::FrameGeometry& geometry,
                         frames::Rate refresh) const {
  return display_ && connector_ == panel.connector && display_->mode().geometry == geometry &&
         display_->mode().refresh == refresh &&
         display_->statistics().panel == display::PanelState::Showing;
}

void PanelCard::open(const display::PanelInfo& panel, const frames::FrameGeometry& geometry,
                     frames::Rate refresh) {
  close();
  display::KmsOptions options = services_;
  options.output = {.connector = panel.connector,
                    .policy = display::IdentityPolicy::Ignore,
                    .panel = geometry,
                    .refresh = refresh};
  options.previous.reset();
  options.buffers = display::kMinScanoutBuffers;
  display_ = display::open_kms_display(options);
  sink_ = std::make_unique<display::DisplaySink>(*display_);
  connector_ = panel.connector;
}

void PanelCard::close() noexcept {
  sink_.reset();
  display_.reset();
  frame_ = {};
}

bool PanelCard::wait(Nanoseconds deadline, int wake_fd) {
  if (!display_) return true;
  const uint64_t heard = display_->statistics().hotplugs;
  while (display_->now() < deadline) {
    const Nanoseconds nap = std::min(deadline, display_->now() + kNap);
    if (display_->wait_event(nap, wake_fd).kind == display::EventKind::Lost) {
      close();
      return true;
    }
    if (display_->statistics().hotplugs != heard) return true;
    if (display_->now() < nap) return false;
  }
  return false;
}

}  // namespace lenticule::player
