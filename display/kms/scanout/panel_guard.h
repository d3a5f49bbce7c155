// SPDX-License-Identifier: Apache-2.0
// PanelGuard monitors the panel on an active output: its identity, whether it still offers the
// mode, and the reaction that a change needs.
#pragma once

#include <memory>

#include "display/clock.h"
#include "display/kms/probe/output_request.h"
#include "display/kms/scanout/kms_counters.h"
#include "display/kms/scanout/kms_output.h"
#include "display/kms/scanout/panel_watch.h"

namespace lenticule::display {

/// Returns the state of a panel for frames in `mode`. `connector` null =
/// the connector is gone.
[[nodiscard]] PanelState judge_panel(const ConnectorInfo* connector, const OutputRequest& request,
                                     const drmModeModeInfo& mode);

/// Audits the output repeatedly while monitoring. Thread safety: one thread.
class PanelGuard {
 public:
  /// Lifetime: `output`, whose connector data the guard updates, `request` and `counters` must
  /// outlive the guard.
  PanelGuard(KmsOutput& output, const OutputRequest& request,
             std::unique_ptr<HotplugMonitor> monitor, std::shared_ptr<Clock> clock,
             KmsCounters& counters);

  /// Returns a descriptor that is readable when follow() should be called; -1 if never.
  [[nodiscard]] int fd() const noexcept { return watch_.fd(); }
  /// Returns the time at which follow() should be called next.
  [[nodiscard]] Nanoseconds next_due() const noexcept;
  /// Checks the panel at once.
  void look() noexcept;

  enum class Advice {
    GoOn,
    Relight,  ///< the panel is back, its link must be trained again, or a property was changed
    GoDark,   ///< frames woven for another panel are wrong for every viewer, so the output is
              ///< switched off
  };
  /// Handles pending hotplug events and returns the reaction that they need.
  [[nodiscard]] Advice follow(bool news_waiting) noexcept;

 private:
  [[nodiscard]] Advice heed(const PanelNews& news);
  void look_again() noexcept;

  KmsOutput& output_;
  const OutputRequest& request_;
  std::shared_ptr<Clock> clock_;
  KmsCounters& counters_;
  PanelWatch watch_;
  Nanoseconds look_at_;
};

}  // namespace lenticule::display
