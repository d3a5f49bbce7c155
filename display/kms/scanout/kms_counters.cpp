// SPDX-License-Identifier: Apache-2.0
#include "display/kms/scanout/kms_counters.h"

namespace lenticule::display {

KmsStatistics KmsCounters::snapshot() const noexcept {
  return {.flips = flips.get(),
          .busy = busy.get(),
          .denied = denied.get(),
          .refused = refused.get(),
          .flip_timeouts = flip_timeouts.get(),
          .stray_events = stray_events.get(),
          .truncated_reads = truncated_reads.get(),
          .recoveries = recoveries.get(),
          .modesets = modesets.get(),
          .hotplugs = hotplugs.get(),
          .links_bad = links_bad.get(),
          .suspends = suspends.get(),
          .pauses = pauses.get(),
          .lost_ticks = lost_ticks.get(),
          .largest_skew = Nanoseconds(largest_skew_ns.load(std::memory_order_relaxed)),
          .panel = panel.load(std::memory_order_relaxed),
          .hardware_clock = hardware_clock.load(std::memory_order_relaxed),
          .off = off.load(std::memory_order_relaxed)};
}

const char* panel_state_name(PanelState state) {
  switch (state) {
    case PanelState::Showing:
      return "showing";
    case PanelState::Disconnected:
      return "disconnected";
    case PanelState::Unreadable:
      return "unreadable";
    case PanelState::ModeMissing:
      return "mode missing";
    case PanelState::WrongPanel:
      return "wrong panel";
  }
  return "?";
}

}  // namespace lenticule::display
