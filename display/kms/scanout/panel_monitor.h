// SPDX-License-Identifier: Apache-2.0
// PanelMonitor monitors the panels on an active output: their identities, whether they still offer
// the modes, and the reaction that a change needs.
#pragma once

#include <algorithm>
#include <atomic>
#include <functional>
#include <memory>
#include <mutex>
#include <optional>
#include <thread>
#include <vector>

#include "base/unique_fd.h"
#include "display/clock.h"
#include "display/kms/device/connector.h"
#include "display/kms/device/platform.h"
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
                  Audit audit = nullptr);
  ~ConnectorProber();
  ConnectorProber(const ConnectorProber&) = delete;
  ConnectorProber& operator=(const ConnectorProber&) = delete;

  /// Returns a descriptor that is readable when take_event() or, without its own thread, step()
  /// should be called.
  [[nodiscard]] int fd() const noexcept {
    return clock_->real_time() ? ready_.fd() : hotplug_->fd();
  }
  /// Returns, without its own thread, the time at which step() is due; otherwise never.
  [[nodiscard]] Nanoseconds next_step() const noexcept;
  void step() noexcept;

  /// Returns the newest change since the last call, if there was one.
  [[nodiscard]] std::optional<HotplugEvent> take_event() noexcept;
  /// Returns true once after an audit that asked for a modeset.
  [[nodiscard]] bool take_modeset_request() noexcept {
    return modeset_requested_.exchange(false, std::memory_order_relaxed);
  }
  /// Requests a probe now, reported even if nothing changed. Thread safety: any thread.
  void request_probe() noexcept;

 private:
  void run() noexcept;
  void work(Nanoseconds now);
  void audit_if_due(Nanoseconds now, bool hotplug);
  void report(HotplugEvent event);
  [[nodiscard]] HotplugEvent read(Probe probe) const;

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
  bool stopping_ = false;

  std::thread thread_;
};

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
