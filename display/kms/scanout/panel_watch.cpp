// SPDX-License-Identifier: Apache-2.0
#include "display/kms/scanout/panel_watch.h"

#include <fmt/format.h>
#include <poll.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstring>
#include <utility>

#include "base/error.h"

namespace lenticule::display {
namespace {

/// A panel causes bursts of hotplug events; one probe after the burst is enough.
constexpr Nanoseconds kDebounce = std::chrono::milliseconds(200);
/// Polling interval, in case events are lost or blocked by a sandbox.
constexpr Nanoseconds kSlowLook = std::chrono::seconds(30);
constexpr Nanoseconds kBetweenAudits = std::chrono::seconds(3);
constexpr Nanoseconds kLongestSleep = std::chrono::seconds(1);

}  // namespace

PanelWatch::PanelWatch(int card_fd, const ConnectorInfo& seen,
                       std::unique_ptr<HotplugMonitor> monitor, std::shared_ptr<Clock> clock,
                       Running running, PanelChores chores)
    : card_fd_(card_fd),
      connector_id_(seen.id),
      monitor_(std::move(monitor)),
      clock_(std::move(clock)),
      running_(running),
      chores_(std::move(chores)),
      poke_("kms"),
      told_("kms"),
      connected_(seen.connected),
      link_bad_(seen.link_bad),
      slow_look_at_(clock_->now() + kSlowLook),
      audit_at_(chores_.audit ? clock_->now() + kBetweenAudits : Nanoseconds::max()) {
  if (running_ == Running::OwnThread) thread_ = std::thread([this] { run(); });
}

PanelWatch::~PanelWatch() {
  {
    const std::lock_guard lock(mutex_);
    stopping_ = true;
  }
  poke_.signal();
  if (thread_.joinable()) thread_.join();
}

int PanelWatch::fd() const noexcept {
  return running_ == Running::OwnThread ? told_.fd() : monitor_->fd();
}

Nanoseconds PanelWatch::next_step() const noexcept {
  if (running_ == Running::OwnThread) return Nanoseconds::max();
  return std::min({probe_at_.value_or(Nanoseconds::max()), slow_look_at_, audit_at_});
}

void PanelWatch::step() noexcept {
  if (running_ == Running::OwnThread) return;
  try {
    look(clock_->now());
  } catch (...) {
    probe_at_ = clock_->now() + kDebounce;  // out of memory: try again
  }
}

std::optional<PanelNews> PanelWatch::take_news() noexcept {
  told_.drain();
  const std::lock_guard lock(mutex_);
  return std::exchange(news_, std::nullopt);
}

bool PanelWatch::take_wish_to_relight() noexcept {
  return relight_wished_.exchange(false, std::memory_order_relaxed);
}

void PanelWatch::request_probe() noexcept {
  {
    const std::lock_guard lock(mutex_);
    probe_requested_ = true;
  }
  poke_.signal();
  step();
}

void PanelWatch::run() noexcept {
  while (true) {
    {
      const std::lock_guard lock(mutex_);
      if (stopping_) return;
    }
    const Nanoseconds now = clock_->now();
    const Nanoseconds until =
        std::min({probe_at_.value_or(slow_look_at_), slow_look_at_, audit_at_});
    const auto sleep = std::clamp(until - now, Nanoseconds{0}, kLongestSleep);
    std::array<pollfd, 2> entries = {pollfd{.fd = poke_.fd(), .events = POLLIN, .revents = 0},
                                     pollfd{.fd = monitor_->fd(), .events = POLLIN, .revents = 0}};
    (void)poll(entries.data(), entries.size(),
               static_cast<int>(std::chrono::ceil<std::chrono::milliseconds>(sleep).count()));
    poke_.drain();
    try {
      look(clock_->now());
    } catch (...) {
      probe_at_ = clock_->now() + kDebounce;
    }
  }
}

/// Does one round: reads hotplug events, and probes if a probe is due.
void PanelWatch::look(Nanoseconds now) {
  const bool news = monitor_->drain();
  if (news && !probe_at_) probe_at_ = now + kDebounce;
  audit_if_due(now, news);
  bool asked = false;
  {
    const std::lock_guard lock(mutex_);
    asked = std::exchange(probe_requested_, false);
  }
  if (now >= slow_look_at_) {
    slow_look_at_ = now + kSlowLook;
    const auto current = read_connector(card_fd_, connector_id_, Probe::Cached);
    if (!current || current->connected != connected_ || current->link_bad != link_bad_)
      probe_at_ = now;
  }
  if (!asked && (!probe_at_ || now < *probe_at_)) return;
  probe_at_.reset();
  probe();
}

/// Audits if due; after a hotplug event, as soon as its burst is over.
void PanelWatch::audit_if_due(Nanoseconds now, bool news) {
  if (!chores_.audit) return;
  if (news && !audit_has_news_) {
    audit_has_news_ = true;
    audit_at_ = std::min(audit_at_, now + kDebounce);
  }
  if (now < audit_at_) return;
  audit_at_ = now + kBetweenAudits;
  if (!chores_.audit(std::exchange(audit_has_news_, false))) return;
  relight_wished_.store(true, std::memory_order_relaxed);
  told_.signal();
}

void PanelWatch::probe() {
  tell(read_connector(card_fd_, connector_id_, Probe::Full));
}

void PanelWatch::tell(std::optional<ConnectorInfo> connector) {
  if (connector) {
    connected_ = connector->connected;
    link_bad_ = connector->link_bad;
  } else {
    connected_ = false;
  }
  {
    const std::lock_guard lock(mutex_);
    news_ = PanelNews{.connector = std::move(connector)};
  }
  told_.signal();
}

}  // namespace lenticule::display
