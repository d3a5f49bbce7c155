// SPDX-License-Identifier: Apache-2.0
// PanelCard shows a test card on a panel that is not the requested one, in that panel's own mode.
// The functions write the texts of the cards.
#pragma once

#include <cstdint>
#include <memory>
#include <string>

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

/// Returns the card that is shown while `what` cannot be played and is tried again.
[[nodiscard]] display::CardText error_card(const std::string& what, const Error& error);

/// Returns the card of `lenticule play card`.
[[nodiscard]] display::CardText rig_card(const optics::Rig& rig, const std::string& file);

/// Opens the graphics card that drives the panel; close() closes it again. Thread safety: one
/// thread.
class PanelCard {
 public:
  /// `services` supplies the clock, session and platform, and the exit policy for the panel.
  explicit PanelCard(const display::KmsOptions& services) : services_(services) {}

  /// Shows the card on `panel`, unless it is shown there already. Returns false if the panel cannot
  /// show it.
  bool show(const display::PanelInfo& panel, const display::CardText& text);
  void close() noexcept;

  /// Runs the display until `deadline`, or until `wake_fd` (or -1) is readable. Returns true, and
  /// earlier, after a hotplug event of any panel.
  [[nodiscard]] bool wait(display::Nanoseconds deadline, int wake_fd);

  /// Returns the display; null while no card is shown.
  [[nodiscard]] const display::KmsDisplay* display() const { return display_.get(); }

 private:
  [[nodiscard]] bool shows_on(const display::PanelInfo& panel,
                              const frames::FrameGeometry& geometry, frames::Rate refresh) const;
  void open(const display::PanelInfo& panel, const frames::FrameGeometry& geometry,
            frames::Rate refresh);

  display::KmsOptions services_;
  std::unique_ptr<display::KmsDisplay> display_;
  std::unique_ptr<display::DisplaySink> sink_;
  std::string connector_;
  frames::WovenFrame frame_;
};

}  // namespace lenticule::player
