// SPDX-License-Identifier: Apache-2.0
// PanelMonitor monitors the panels on an active output: their identities, whether they still offer
// the modes, and the reaction that a change needs.
#pragma once

#include <poll.h>

#include <algorithm>
#include <array>
#include <atomic>
#include <functional>
#include <memory>
#include <mutex>
#include <optional>
#include <thread>
#include <utility>
#include <vector>

#include "base/unique_fd.h"
#include "display/clock.h"
#include "display/kms/device/connector.h"
#include "display/kms/device/platform.h"
#include "display/kms/probe/output_choice.h"
#include "display/kms/probe/output_request.h"
#include "display/kms/scanout/kms_output.h"

namespace lenticule::display {

struct HotplugEvent {
  /// The output's connectors, in its order. Empty: one of them is gone from the card.
  std::vector<ConnectorInfo> connectors;

  [[nodiscard]] bool all_connected() const {
    return !connectors.empty() && std::ranges::all_of(connectors, &ConnectorInfo::connected);
  }
  [[nodiscard]] bool any_link_bad() const {
    return std::ranges::any_of(connectors, &ConnectorInfo::link_bad);
  }
};

/// ConnectorProber probes the connectors of one output after hotplug events, and checks them slowly
/// without events, in case one is lost. It also audits the output.
/// Probing a panel may take hundreds of milliseconds, so in real time it runs on a separate thread;
/// in simulated time inside step(). Lifetime: the card's descriptor must outlive this object.
class ConnectorProber {
 public:
  /// Called every few seconds, and with `after_hotplug` soon after a hotplug event. Returns true if
  /// a modeset would help.
  using Audit = std::function<bool(bool after_hotplug)>;

  /// `connectors` are the output's, of which `seen` is the first. `audit` may be null. Throws
  /// Error(Failed) if there are no descriptors or threads.
  ConnectorProber(int card_fd, const ConnectorInfo& seen, std::vector<uint32_t> connectors,
                  std::unique_ptr<HotplugMonitor> hotplug, std::shared_ptr<Clock> clock,
                  Audit audit = nullptr)
      : card_fd_(card_fd),
        connectors_(std::move(connectors)),
        hotplug_(std::move(hotplug)),
        clock_(std::move(clock)),
        audit_(std::move(audit)),
        wake_("kms"),
        ready_("kms"),
        connected_(seen.connected),
        link_bad_(seen.link_bad),
        poll_at_(clock_->now() + kPollInterval),
        audit_at_(audit_ ? clock_->now() + kAuditInterval : kNever) {
    if (clock_->real_time())
      thread_ = std::jthread([this](const std::stop_token& stop) { run(stop); });
  }
  ~ConnectorProber() {
    thread_.request_stop();
    wake_.signal();
  }

  /// Returns a descriptor that is readable when take_event() or, without its own thread, step()
  /// should be called.
  [[nodiscard]] int fd() const noexcept {
    return clock_->real_time() ? ready_.fd() : hotplug_->fd();
  }
  /// Returns, without its own thread, the time at which step() is due; otherwise never.
  [[nodiscard]] Nanoseconds next_step() const noexcept {
    if (clock_->real_time()) return kNever;
    return std::min({probe_at_.value_or(kNever), poll_at_, audit_at_});
  }
  void step() noexcept {
    if (!clock_->real_time()) work();
  }

  /// Returns the newest change since the last call, if there was one.
  [[nodiscard]] std::optional<HotplugEvent> take_event() noexcept {
    ready_.drain();
    const std::lock_guard lock(mutex_);
    return std::exchange(event_, std::nullopt);
  }
  /// Returns true once after an audit that asked for a modeset.
  [[nodiscard]] bool take_modeset_request() noexcept {
    return modeset_requested_.exchange(false, std::memory_order_relaxed);
  }
  /// Requests a probe now, reported even if nothing changed. Thread safety: any thread.
  void request_probe() noexcept {
    {
      const std::lock_guard lock(mutex_);
      probe_requested_ = true;
    }
    wake_.signal();
    step();
  }

 private:
  /// A panel causes bursts of hotplug events; one probe after the burst is enough.
  static constexpr Nanoseconds kDebounce = std::chrono::milliseconds(200);
  /// Polling interval, in case events are lost or blocked by a sandbox.
  static constexpr Nanoseconds kPollInterval = std::chrono::seconds(30);
  static constexpr Nanoseconds kAuditInterval = std::chrono::seconds(3);
  static constexpr Nanoseconds kLongestSleep = std::chrono::seconds(1);
  void run(const std::stop_token& stop) noexcept {
    while (!stop.stop_requested()) {
      const Nanoseconds now = clock_->now();
      const Nanoseconds until = std::min({probe_at_.value_or(poll_at_), poll_at_, audit_at_});
      const auto sleep = std::clamp(until - now, Nanoseconds{0}, kLongestSleep);
      std::array<pollfd, 2> entries = {
          pollfd{.fd = wake_.fd(), .events = POLLIN, .revents = 0},
          pollfd{.fd = hotplug_->fd(), .events = POLLIN, .revents = 0}};
      (void)poll(entries.data(), entries.size(),
                 static_cast<int>(std::chrono::ceil<std::chrono::milliseconds>(sleep).count()));
      wake_.drain();
      work();
    }
  }
  void work() noexcept {
    try {
      do_round(clock_->now());
    } catch (...) {
      probe_at_ = clock_->now() + kDebounce;  // out of memory: try again
    }
  }
  /// Reads hotplug events, and probes if a probe is due.
  void do_round(Nanoseconds now) {
    const bool hotplug = hotplug_->drain();
    if (hotplug && !probe_at_) probe_at_ = now + kDebounce;
    audit_if_due(now, hotplug);
    bool requested = false;
    {
      const std::lock_guard lock(mutex_);
      requested = std::exchange(probe_requested_, false);
    }
    if (now >= poll_at_) {
      poll_at_ = now + kPollInterval;
      const HotplugEvent current = read(Probe::Cached);
      if (current.all_connected() != connected_ || current.any_link_bad() != link_bad_)
        probe_at_ = now;
    }
    if (!requested && (!probe_at_ || now < *probe_at_)) return;
    probe_at_.reset();
    report(read(Probe::Full));
  }
  /// Audits if due; after a hotplug event, as soon as its burst is over.
  void audit_if_due(Nanoseconds now, bool hotplug) {
    if (!audit_) return;
    if (hotplug && !audit_after_hotplug_) {
      audit_after_hotplug_ = true;
      audit_at_ = std::min(audit_at_, now + kDebounce);
    }
    if (now < audit_at_) return;
    audit_at_ = now + kAuditInterval;
    if (!audit_(std::exchange(audit_after_hotplug_, false))) return;
    modeset_requested_.store(true, std::memory_order_relaxed);
    ready_.signal();
  }
  void report(HotplugEvent event) {
    connected_ = event.all_connected();
    link_bad_ = event.any_link_bad();
    {
      const std::lock_guard lock(mutex_);
      event_ = std::move(event);
    }
    ready_.signal();
  }
  [[nodiscard]] HotplugEvent read(Probe probe) const {
    HotplugEvent event;
    for (const uint32_t id : connectors_) {
      auto connector = read_connector(card_fd_, id, probe);
      if (!connector) return {};
      event.connectors.push_back(std::move(*connector));
    }
    return event;
  }

  int card_fd_;
  std::vector<uint32_t> connectors_;
  std::unique_ptr<HotplugMonitor> hotplug_;
  std::shared_ptr<Clock> clock_;
  Audit audit_;
  WakeFd wake_;   ///< request_probe() and the end
  WakeFd ready_;  ///< an event or a modeset request can be taken

  // Used by the probing thread only.
  bool connected_;
  bool link_bad_;
  std::optional<Nanoseconds> probe_at_;
  Nanoseconds poll_at_;
  Nanoseconds audit_at_;
  bool audit_after_hotplug_ = false;

  std::atomic<bool> modeset_requested_{false};

  std::mutex mutex_;  ///< guards the members below
  std::optional<HotplugEvent> event_;
  bool probe_requested_ = false;

  std::jthread thread_;  // last member: the thread uses everything above
};

inline bool is_expected(const ConnectorInfo& connector, const OutputRequest& request, size_t n) {
  const optics::PanelIdentity& identity = request.identity_of(n);
  return request.policy == IdentityPolicy::Ignore || identity.empty() ||
         (connector.edid.identity && matches(identity, *connector.edid.identity));
}

/// Returns the state of the panel on the n-th connector of the output for frames in `mode`.
[[nodiscard]] inline PanelState evaluate_panel(const ConnectorInfo& connector,
                                               const OutputRequest& request, size_t n,
                                               const drmModeModeInfo& mode) {
  if (!connector.connected) return PanelState::Disconnected;
  // The first tile of a panel identifies it.
  if (n > 0 && request.parts.empty()) return PanelState::Showing;
  if (!is_expected(connector, request, n))
    return connector.edid.problem == EdidProblem::None ? PanelState::WrongPanel
                                                       : PanelState::Unreadable;
  return offers_mode(connector, mode) ? PanelState::Showing : PanelState::ModeMissing;
}

/// Audits the output repeatedly while monitoring. Thread safety: one thread.
class PanelMonitor {
 public:
  /// Lifetime: `output`, whose connector data the monitor updates, `request` and `counters` must
  /// outlive the monitor.
  PanelMonitor(KmsOutput& output, const OutputRequest& request,
               std::unique_ptr<HotplugMonitor> hotplug, std::shared_ptr<Clock> clock,
               KmsCounters& counters)
      : output_(output),
        request_(request),
        clock_(std::move(clock)),
        counters_(counters),
        prober_(output.device().fd(), output.pipe().connector, output.connectors(),
                std::move(hotplug), clock_,
                [&output](bool after_hotplug) {
                  return output.audit_again(after_hotplug ? AuditDepth::Everything
                                                          : AuditDepth::Properties);
                }),
        check_at_(kNever) {
    counters_.panel = PanelState::Showing;
  }

  /// Returns a descriptor that is readable when handle_events() should be called; -1 if never.
  [[nodiscard]] int fd() const noexcept { return prober_.fd(); }
  /// Returns the time at which handle_events() should be called next.
  [[nodiscard]] Nanoseconds next_due() const noexcept {
    return std::min(prober_.next_step(), check_at_);
  }
  /// Requests a probe of the panel now.
  void check_now() noexcept { check_at_ = std::min(check_at_, clock_->now()); }

  enum class Action {
    None,
    SetMode,    ///< the panel is back, its link must be trained again, or a property was changed
    SwitchOff,  ///< frames woven for another panel are wrong for every viewer
  };
  /// Handles pending hotplug events and returns the action that they need.
  [[nodiscard]] Action handle_events(bool event_waiting) noexcept {
    const Nanoseconds now = clock_->now();
    if (event_waiting || now >= prober_.next_step()) prober_.step();
    if (now >= check_at_) {
      check_at_ = kNever;
      prober_.request_probe();
    }
    const Action without_event = prober_.take_modeset_request() ? Action::SetMode : Action::None;
    const auto event = prober_.take_event();
    if (!event) return without_event;
    ++counters_.hotplugs;
    try {
      const Action action = on_event(*event);
      return action == Action::None ? without_event : action;
    } catch (...) {
      check_later();  // out of memory
      return without_event;
    }
  }

 private:
  static constexpr Nanoseconds kCheckInterval = std::chrono::seconds(2);
  /// Returns the state of the panel that needs most: a disconnected one, then a wrong one, then one
  /// that is not ready.
  [[nodiscard]] PanelState worst_state(const HotplugEvent& event) const {
    if (!event.all_connected()) return PanelState::Disconnected;
    PanelState worst = PanelState::Showing;
    for (size_t n = 0; n < event.connectors.size(); ++n) {
      const PanelState state =
          evaluate_panel(event.connectors[n], request_, n, output_.pipe(n).mode);
      if (state == PanelState::WrongPanel) return state;
      if (worst == PanelState::Showing) worst = state;
    }
    return worst;
  }
  /// Returns the action that a hotplug event needs. While no panel is connected the CRTC stays on:
  /// a panel that is only switched off and on then needs no modeset.
  [[nodiscard]] Action on_event(const HotplugEvent& event) {
    const PanelState state = worst_state(event);
    const PanelState before = counters_.panel.exchange(state);
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
    if (link_bad) ++counters_.links_bad;
    const bool needs_modeset = before != PanelState::Showing || link_bad;
    for (size_t n = 0; n < event.connectors.size(); ++n)
      output_.update_connector(n, event.connectors[n]);
    return needs_modeset ? Action::SetMode : Action::None;
  }
  void check_later() noexcept { check_at_ = clock_->now() + kCheckInterval; }

  KmsOutput& output_;
  const OutputRequest& request_;
  std::shared_ptr<Clock> clock_;
  KmsCounters& counters_;
  ConnectorProber prober_;
  Nanoseconds check_at_;
};

}  // namespace lenticule::display
