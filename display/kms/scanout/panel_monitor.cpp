// SPDX-License-Identifier: Apache-2.0
#include "display/kms/scanout/panel_monitor.h"

#include <algorithm>
#include <utility>

#include "display/kms/probe/pipe.h"

namespace lenticule::display {
namespace {

constexpr Nanoseconds kCheckInterval = std::chrono::seconds(2);

bool is_expected(const ConnectorInfo& connector, const OutputRequest& request, size_t n) {
  const optics::PanelIdentity& identity = request.identity_of(n);
  return request.policy == IdentityPolicy::Ignore || identity.empty() ||
         (connector.edid.identity && matches(identity, *connector.edid.identity));
}

ConnectorProber::Running running_by(const Clock& clock) {
  return clock.real_time() ? ConnectorProber::Running::OwnThread : ConnectorProber::Running::InStep;
}

}  // namespace

PanelState evaluate_panel(const ConnectorInfo& connector, const OutputRequest& request, size_t n,
                          const drmModeModeInfo& mode) {
  if (!connector.connected) return PanelState::Disconnected;
  // The first tile of a panel identifies it.
  if (n > 0 && request.parts.empty()) return PanelState::Showing;
  if (!is_expected(connector, request, n))
    return connector.edid.problem == EdidProblem::None ? PanelState::WrongPanel
                                                       : PanelState::Unreadable;
  return offers_mode(connector, mode) ? PanelState::Showing : PanelState::ModeMissing;
}

PanelMonitor::PanelMonitor(KmsOutput& output, const OutputRequest& request,
                           std::unique_ptr<HotplugMonitor> hotplug, std::shared_ptr<Clock> clock,
                           KmsCounters& counters)
    : output_(output),
      request_(request),
      clock_(std::move(clock)),
      counters_(counters),
      prober_(output.device().fd(), output.pipe().connector, output.connectors(),
              std::move(hotplug), clock_, running_by(*clock_),
              [&output](bool after_hotplug) {
                return output.audit_again(after_hotplug ? AuditDepth::Everything
                                                        : AuditDepth::Properties);
              }),
      check_at_(kNever) {
  counters_.panel.store(PanelState::Showing, std::memory_order_relaxed);
}

Nanoseconds PanelMonitor::next_due() const noexcept {
  return std::min(prober_.next_step(), check_at_);
}

void PanelMonitor::check_now() noexcept {
  check_at_ = std::min(check_at_, clock_->now());
}

void PanelMonitor::check_later() noexcept {
  check_at_ = clock_->now() + kCheckInterval;
}

PanelMonitor::Action PanelMonitor::handle_events(bool event_waiting) noexcept {
  const Nanoseconds now = clock_->now();
  if (event_waiting || now >= prober_.next_step()) prober_.step();
  if (now >= check_at_) {
    check_at_ = kNever;
    prober_.request_probe();
  }
  const Action without_event = prober_.take_modeset_request() ? Action::SetMode : Action::None;
  const auto event = prober_.take_event();
  if (!event) return without_event;
  counters_.hotplugs.add();
  try {
    const Action action = on_event(*event);
    return action == Action::None ? without_event : action;
  } catch (...) {
    check_later();  // out of memory
    return without_event;
  }
}

/// Returns the state of the panel that needs most: a disconnected one, then a wrong one, then one
/// that is not ready.
PanelState PanelMonitor::worst_state(const HotplugEvent& event) const {
  if (!event.all_connected()) return PanelState::Disconnected;
  PanelState worst = PanelState::Showing;
  for (size_t n = 0; n < event.connectors.size(); ++n) {
    const PanelState state = evaluate_panel(event.connectors[n], request_, n, output_.pipe(n).mode);
    if (state == PanelState::WrongPanel) return state;
    if (worst == PanelState::Showing) worst = state;
  }
  return worst;
}

/// Returns the action that a hotplug event needs. While no panel is connected the CRTC stays on: a
/// panel that is only switched off and on then needs no modeset.
PanelMonitor::Action PanelMonitor::on_event(const HotplugEvent& event) {
  const PanelState state = worst_state(event);
  const PanelState before = counters_.panel.exchange(state, std::memory_order_relaxed);
  switch (state) {
    case PanelState::Disconnected:
      return Action::None;
    case PanelState::Unreadable:
    case PanelState::ModeMissing:
      check_later();
      return Action::None;
    case PanelState::WrongPanel:
      return Action::SwitchOff;
    case PanelState::Showing:
      break;
  }
  const bool link_bad = event.any_link_bad();
  if (link_bad) counters_.links_bad.add();
  const bool needs_modeset = before != PanelState::Showing || link_bad;
  for (size_t n = 0; n < event.connectors.size(); ++n)
    output_.update_connector(n, event.connectors[n]);
  return needs_modeset ? Action::SetMode : Action::None;
}

}  // namespace lenticule::display
