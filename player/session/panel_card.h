// SPDX-License-Identifier: Apache-2.0
// PanelCard shows a test card on a panel that is not the requested one, in that panel's own mode.
// The functions write the texts of the cards.
#pragma once

#include <algorithm>
#include <cstdint>
#include <memory>
#include <string>
#include <utility>

#include "base/error.h"
#include "display/display_sink.h"
#include "display/kms/inspect.h"
#include "display/kms/scanout/kms_display.h"
#include "display/test_card.h"
#include "optics/rig.h"

namespace lenticule::player {

/// Describes the panel that a rig names: "3840x2160 pixels, LGD 0x1234 serial 42".
[[nodiscard]] std::string describe_expected(const frames::FrameGeometry& panel,
                                            const optics::PanelIdentity& identity);
/// Describes a connected panel: "HDMI-A-1: LGD 0x1234 serial 42 'name', 3840x2160@60".
[[nodiscard]] std::string describe_found(const display::PanelInfo& panel);

/// Returns the card that is shown on `shown_on`, one of the panels that are connected instead of
/// the requested one. `rig` is the name of the rig's file.
[[nodiscard]] display::CardText wrong_panel_card(const display::OutputRequest& request,
                                                 const display::PanelSearch& search,
                                                 const display::PanelInfo& shown_on,
                                                 const std::string& rig);

/// Returns the card that is shown while `what` cannot be played and is tried again; `state` as in
/// PlayState.
[[nodiscard]] display::CardText error_card(const std::string& what, const Error& error,
                                           const std::string& state = "failed");

/// Returns the card of `lenticule play card`.
[[nodiscard]] display::CardText rig_card(const optics::Rig& rig, const std::string& file);

/// Opens the graphics card that drives the panel; close() closes it again. Thread safety: one
/// thread.
class PanelCard {
 public:
  /// Returns the mode that the panel itself prefers, of all or of those that show a frame pixel for
  /// pixel; null if there is none.
  [[nodiscard]] static const display::ModeInfo* preferred_mode(const display::PanelInfo& panel,
                                                               bool usable_ones) {
    const display::ModeInfo* best = nullptr;
    for (const display::ModeInfo& mode : panel.modes)
      if ((mode.usable || !usable_ones) &&
          (best == nullptr || (mode.preferred && !best->preferred)))
        best = &mode;
    return best;
  }
  /// `services` supplies the clock, session and platform, and the exit policy for the panel.
  explicit PanelCard(const display::KmsOptions& services) : services_(services) {}

  /// Shows the card on `panel`, unless it is shown there already. Returns false if the panel cannot
  /// show it.
  bool show(const display::PanelInfo& panel, const display::CardText& text) {
    const display::ModeInfo* const mode = preferred_mode(panel, true);
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
  void close() noexcept {
    sink_.reset();
    display_.reset();
    frame_ = {};
  }

  /// Waits until `deadline`, or until `wake_fd` (or -1) is readable, and runs the display
  /// meanwhile. Returns true, and earlier, after a hotplug event of any panel.
  [[nodiscard]] bool wait(display::Nanoseconds deadline, int wake_fd) {
    if (!display_) {
      (void)services_.clock->wait_until(deadline, wake_fd);
      return false;
    }
    const uint64_t heard = display_->statistics().hotplugs;
    while (display_->now() < deadline) {
      const display::Nanoseconds nap = std::min(deadline, display_->now() + kNap);
      if (display_->wait_event(nap, wake_fd).kind == display::EventKind::Lost) {
        close();
        return true;
      }
      if (display_->statistics().hotplugs != heard) return true;
      if (display_->now() < nap) return false;
    }
    return false;
  }

  /// Returns the display; null while no card is shown.
  [[nodiscard]] const display::KmsDisplay* display() const { return display_.get(); }

 private:
  static constexpr display::Nanoseconds kTimeout = std::chrono::seconds(5);
  /// Longest time between two checks for hotplug events.
  static constexpr display::Nanoseconds kNap = std::chrono::milliseconds(500);
  /// Returns true if the card is shown on that panel. Compares the refresh too: another panel on
  /// the same connector may have the same size with other timings.
  [[nodiscard]] bool shows_on(const display::PanelInfo& panel,
                              const frames::FrameGeometry& geometry, frames::Rate refresh) const {
    return display_ && connector_ == panel.connector && display_->mode().geometry == geometry &&
           display_->mode().refresh == refresh &&
           display_->statistics().panel == display::PanelState::Showing;
  }
  void open(const display::PanelInfo& panel, const frames::FrameGeometry& geometry,
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

  display::KmsOptions services_;
  std::unique_ptr<display::KmsDisplay> display_;
  std::unique_ptr<display::DisplaySink> sink_;
  std::string connector_;
  frames::WovenFrame frame_;
};

}  // namespace lenticule::player
