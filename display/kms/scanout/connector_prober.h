// SPDX-License-Identifier: Apache-2.0
// ConnectorProber probes the connectors of one output after hotplug events, and checks them slowly
// without events, in case one is lost. It also audits the output.
#pragma once

#include <atomic>
#include <functional>
#include <memory>
#include <mutex>
#include <optional>
#include <thread>
#include <vector>

#include "base/wake_fd.h"
#include "display/clock.h"
#include "display/kms/device/connector.h"
#include "display/kms/device/platform.h"

namespace lenticule::display {

struct HotplugEvent {
  /// The output's connectors, in its order. Empty: one of them is gone from the card.
  std::vector<ConnectorInfo> connectors;

  [[nodiscard]] bool all_connected() const;
  [[nodiscard]] bool any_link_bad() const;
};

/// Probing a panel may take hundreds of milliseconds, so in real time it runs on a separate thread;
/// in simulated time inside step(). Lifetime: the card's descriptor must outlive this object.
class ConnectorProber {
 public:
  enum class Running { OwnThread, InStep };
  /// Called every few seconds, and with `after_hotplug` soon after a hotplug event. Returns true if
  /// a modeset would help.
  using Audit = std::function<bool(bool after_hotplug)>;

  /// `connectors` are the output's, of which `seen` is the first. `audit` may be null. Throws
  /// Error(Failed) if there are no descriptors or threads.
  ConnectorProber(int card_fd, const ConnectorInfo& seen, std::vector<uint32_t> connectors,
                  std::unique_ptr<HotplugMonitor> hotplug, std::shared_ptr<Clock> clock,
                  Running running, Audit audit = nullptr);
  ~ConnectorProber();
  ConnectorProber(const ConnectorProber&) = delete;
  ConnectorProber& operator=(const ConnectorProber&) = delete;

  /// Returns a descriptor that is readable when take_event() or, without its own thread, step()
  /// should be called.
  [[nodiscard]] int fd() const noexcept;
  /// Returns, without its own thread, the time at which step() is due; otherwise never.
  [[nodiscard]] Nanoseconds next_step() const noexcept;
  void step() noexcept;

  /// Returns the newest change since the last call, if there was one.
  [[nodiscard]] std::optional<HotplugEvent> take_event() noexcept;
  /// Returns true once after an audit that asked for a modeset.
  [[nodiscard]] bool take_modeset_request() noexcept;
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
  Running running_;
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

}  // namespace lenticule::display
