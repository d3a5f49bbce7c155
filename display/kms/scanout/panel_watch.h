// SPDX-License-Identifier: Apache-2.0
// Keeps an eye on one connector: hotplug news, and a slow look of its own in case none comes.
#pragma once

#include <atomic>
#include <functional>
#include <memory>
#include <mutex>
#include <optional>
#include <thread>

#include "base/unique_fd.h"
#include "display/clock.h"
#include "display/kms/device/connector.h"
#include "display/kms/device/platform.h"

namespace lenticule::display {

struct PanelNews {
  /// None: the connector itself is gone.
  std::optional<ConnectorInfo> connector;
};

/// What is done on the thread that looks, besides looking.
struct PanelChores {
  /// Every few seconds, and with `news` soon after any news: true if relighting would help. Null:
  /// nothing.
  std::function<bool(bool news)> audit;
};

/// Probing a panel may take hundreds of milliseconds, so in real time it happens on a thread of its
/// own; in simulated time inside step(). Borrows the card's descriptor.
class PanelWatch {
 public:
  enum class Running { OwnThread, InStep };

  /// Throws Error(Failed) without descriptors or threads.
  PanelWatch(int card_fd, const ConnectorInfo& seen, std::unique_ptr<HotplugMonitor> monitor,
             std::shared_ptr<Clock> clock, Running running, PanelChores chores = {});
  ~PanelWatch();
  PanelWatch(const PanelWatch&) = delete;
  PanelWatch& operator=(const PanelWatch&) = delete;

  /// Readable when take_news() or, without an own thread, step() has something to do.
  [[nodiscard]] int fd() const noexcept;
  /// Without an own thread: when step() wants to be called next; never otherwise.
  [[nodiscard]] Nanoseconds next_step() const noexcept;
  void step() noexcept;

  /// What changed since the last time, if anything did.
  [[nodiscard]] std::optional<PanelNews> take_news() noexcept;
  /// True once after an audit that asked for relighting.
  [[nodiscard]] bool take_wish_to_relight() noexcept;
  /// Look now, and tell even if nothing changed. Any thread.
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
  UniqueFd poke_;  ///< eventfd: request_probe() and the end
  UniqueFd told_;  ///< eventfd: there is news

  // Of the thread that looks.
  bool connected_;
  bool link_bad_;
  std::optional<Nanoseconds> probe_at_;
  Nanoseconds slow_look_at_;
  Nanoseconds audit_at_;
  bool audit_has_news_ = false;

  std::atomic<bool> relight_wished_{false};

  std::mutex mutex_;  ///< guards the following
  std::optional<PanelNews> news_;
  bool probe_requested_ = false;
  bool stopping_ = false;

  std::thread thread_;
};

}  // namespace lenticule::display
