// SPDX-License-Identifier: Apache-2.0
// A test card on a panel that is not the one wanted, in that panel's own mode.
#pragma once

#include <cstdint>
#include <memory>

#include "display/display_sink.h"
#include "display/kms/scanout/kms_display.h"
#include "display/kms/survey/panel_search.h"
#include "display/test_card.h"

namespace lenticule::player {

/// One thread. Takes the card that the panel hangs on, and gives it back with close().
class PanelCard {
 public:
  /// `services` are the clock, session and platform, and what becomes of the panel afterwards.
  explicit PanelCard(const display::KmsOptions& services) : services_(services) {}

  /// Shows it there, unless it does already. False if the panel cannot show anything.
  bool show(const display::PanelFacts& panel, const display::CardText& text);
  void close() noexcept;

  /// Lets the display work until `deadline`, or until `wake_fd` (or -1) is readable. True, and
  /// earlier, if something was heard of any panel.
  [[nodiscard]] bool wait(display::Nanoseconds deadline, int wake_fd);

  /// Null while no card is shown.
  [[nodiscard]] const display::KmsDisplay* display() const { return display_.get(); }

 private:
  [[nodiscard]] bool shows_on(const display::PanelFacts& panel,
                              const frames::FrameGeometry& geometry, frames::Rate refresh) const;
  void open(const display::PanelFacts& panel, const frames::FrameGeometry& geometry,
            frames::Rate refresh);

  display::KmsOptions services_;
  std::unique_ptr<display::KmsDisplay> display_;
  std::unique_ptr<display::DisplaySink> sink_;
  std::string connector_;
  frames::WovenFrame frame_;
};

}  // namespace lenticule::player
