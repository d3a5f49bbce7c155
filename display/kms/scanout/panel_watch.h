// SPDX-License-Identifier: Apache-2.0
// PanelWatch monitors one connector by hotplug events, and by slow polling in case an event is
// lost.
#pragma once

#include <atomic>
#include <functional>
#include <memory>
#include <mutex>
#include <optional>
#include <thread>

#include "base/wake_fd.h"
#include "display/clock.h"
#include "display/kms/device/connector.h"
#include "display/kms/device/platform.h"

namespace lenticule::display {

struct PanelNews {
  /// None: the connector itself is gone.
  std::optional<ConnectorInfo> connector;
};

/// Additional work for the probing thread.
struct PanelChores {
  /// Called every few seconds, and with `news` soon after a hotplug event. Returns true if a
  /// modeset would help. May be null.
  std::function<bool(bool news)> audit;
};

/// Probing a panel may take hundreds of milliseconds, so in real time it runs on a separate thread;
/// in simulated time inside step(). Lifetime: the card's descriptor must outlive this object.
class PanelWatch {
 public:
  enum class Running { OwnThread, InStep };

  /// Throws Error(Failed) if there are no descriptors or threads.
  PanelWatch(int card_fd, const ConnectorInfo& seen, std::unique_ptr<HotplugMonitor> monitor,
             std::shared_ptr<Clock> clock, Running running, PanelChores chores = {});
  ~PanelWatch();
  PanelWatch(const PanelWatch&) = delete;
  PanelWatch& operator=(const PanelWatch&) = delete;

  /// Returns a descriptor that is readable when take_news() or, without its own thread, step()
  /// should be called.
  [[nodiscard]] int fd() const noexcept;
  /// Returns, without its own thread, the time at which step() is due; otherwise never.
  [[nodiscard]] Nanoseconds next_step() const noexcept;
  void step() noexcept;

  /// Returns the change since the last call, if there was one.
  [[nodiscard]] std::optional<PanelNews> take_news() noexcept;
  /// Returns true once after an audit that asked for a modeset.
  [[nodiscard]] bool take_wish_to_relight() noexcept;
  /// Requests a probe now, reported even if nothing changed. Thread safety: any thread.
  void request_probe() noexcept;

 private:
  void run() noexcept;
  void look(Nanoseconds now);
  void audit_if_due(Nanoseconds now, bool news);
  void probe();
  void tell(std::optional<ConnectorInfo> connector);

  int card_fd_;
  uint32_t connector_id_;
  std::unique_ptr<HotplugMonitor> monitor_;
  std::shared_ptr<Clock> clock_;
  Running running_;
  PanelChores chores_;
  WakeFd poke_;  ///< request_probe() and the end
  WakeFd told_;  ///< a change is ready

  // Used by the probing thread only.
  bool connected_;
  bool link_bad_;
  std::optional<Nanoseconds> probe_at_;
  Nanoseconds slow_look_at_;
  Nanoseconds audit_at_;
  bool audit_has_news_ = false;

  std::atomic<bool> relight_wished_{false};

  std::mutex mutex_;  ///< guards the members below
  std::optional<PanelNews> news_;
  bool probe_requested_ = false;
  bool stopping_ = false;

  std::thread thread_;
};

}  // namespace lenticule::display
