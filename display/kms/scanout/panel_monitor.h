// SPDX-License-Identifier: Apache-2.0
// PanelMonitor monitors the panels on an active output: their identities, whether they still offer
// the modes, and the reaction that a change needs.
#pragma once

#include <memory>

#include "display/clock.h"
#include "display/kms/probe/output_request.h"
#include "display/kms/scanout/connector_prober.h"
#include "display/kms/scanout/kms_counters.h"
#include "display/kms/scanout/kms_output.h"

namespace lenticule::display {

/// Returns the state of the panel on the n-th connector of the output for frames in `mode`.
[[nodiscard]] PanelState evaluate_panel(const ConnectorInfo& connector,
                                        const OutputRequest& request, size_t n,
                                        const drmModeModeInfo& mode);

/// Audits the output repeatedly while monitoring. Thread safety: one thread.
class PanelMonitor {
 public:
  /// Lifetime: `output`, whose connector data the monitor updates, `request` and `counters` must
  /// outlive the monitor.
  PanelMonitor(KmsOutput& output, const OutputRequest& request,
               std::unique_ptr<HotplugMonitor> hotplug, std::shared_ptr<Clock> clock,
               KmsCounters& counters);

  /// Returns a descriptor that is readable when handle_events() should be called; -1 if never.
  [[nodiscard]] int fd() const noexcept { return prober_.fd(); }
  /// Returns the time at which handle_events() should be called next.
  [[nodiscard]] Nanoseconds next_due() const noexcept;
  /// Requests a probe of the panel now.
  void check_now() noexcept;

  enum class Action {
    None,
    SetMode,    ///< the panel is back, its link must be trained again, or a property was changed
    SwitchOff,  ///< frames woven for another panel are wrong for every viewer
  };
  /// Handles pending hotplug events and returns the action that they need.
  [[nodiscard]] Action handle_events(bool event_waiting) noexcept;

 private:
  [[nodiscard]] PanelState worst_state(const HotplugEvent& event) const;
  [[nodiscard]] Action on_event(const HotplugEvent& event);
  void check_later() noexcept;

  KmsOutput& output_;
  const OutputRequest& request_;
  std::shared_ptr<Clock> clock_;
  KmsCounters& counters_;
  ConnectorProber prober_;
  Nanoseconds check_at_;
};

}  // namespace lenticule::display
