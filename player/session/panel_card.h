// SPDX-License-Identifier: Apache-2.0
// PanelCard shows a test card on a panel that is not the requested one, in that panel's own mode.
#pragma once

#include <cstdint>
#include <memory>

#include "display/display_sink.h"
#include "display/kms/inspect.h"
#include "display/kms/scanout/kms_display.h"
#include "display/test_card.h"

namespace lenticule::player {

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
