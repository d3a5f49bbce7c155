// SPDX-License-Identifier: Apache-2.0
#include "display/kms/scanout/panel_guard.h"

#include <algorithm>
#include <utility>

#include "display/kms/probe/pipe.h"

namespace lenticule::display {
namespace {

constexpr Nanoseconds kLookAgain = std::chrono::seconds(2);

bool is_expected(const ConnectorInfo& connector, const OutputRequest& request) {
  return request.policy == IdentityPolicy::Ignore || request.identity.empty() ||
         (connector.edid.identity && matches(request.identity, *connector.edid.identity));
}

PanelWatch::Running running_by(const Clock& clock) {
  return clock.real_time() ? PanelWatch::Running::OwnThread : PanelWatch::Running::InStep;
}

}  // namespace

PanelState judge_panel(const ConnectorInfo* connector, const OutputRequest& request,
                       const drmModeModeInfo& mode) {
  if (connector == nullptr || !connector->connected) return PanelState::Disconnected;
  if (!is_expected(*connector, request))
    return connector->edid.problem == EdidProblem::None ? PanelState::WrongPanel
                                                        : PanelState::Unreadable;
  return offers_mode(*connector, mode) ? PanelState::Showing : PanelState::ModeMissing;
}

PanelGuard::PanelGuard(KmsOutput& output, const OutputRequest& request,
                       std::unique_ptr<HotplugMonitor> monitor, std::shared_ptr<Clock> clock,
                       KmsCounters& counters)
    : output_(output),
      request_(request),
      clock_(std::move(clock)),
      counters_(counters),
      watch_(
          output.device().fd(), output.pipe().connector, std::move(monitor), clock_,
          running_by(*clock_),
          {.audit =
               [&output](bool news) {
                 return output.audit_again(news ? AuditDepth::Everything : AuditDepth::Properties);
               }}),
      look_at_(kNever) {
  counters_.panel.store(PanelState::Showing, std::memory_order_relaxed);
}

Nanoseconds PanelGuard::next_due() const noexcept {
  return std::min(watch_.next_step(), look_at_);
}

void PanelGuard::look() noexcept {
  look_at_ = std::min(look_at_, clock_->now());
}

void PanelGuard::look_again() noexcept {
  look_at_ = clock_->now() + kLookAgain;
}

PanelGuard::Advice PanelGuard::follow(bool news_waiting) noexcept {
  const Nanoseconds now = clock_->now();
  if (news_waiting || now >= watch_.next_step()) watch_.step();
  if (now >= look_at_) {
    look_at_ = kNever;
    watch_.request_probe();
  }
  const Advice without_news = watch_.take_wish_to_relight() ? Advice::Relight : Advice::GoOn;
  const auto news = watch_.take_news();
  if (!news) return without_news;
  counters_.hotplugs.add();
  try {
    const Advice advice = heed(*news);
    return advice == Advice::GoOn ? without_news : advice;
  } catch (...) {
    look_again();  // out of memory: check again later
    return without_news;
  }
}

/// Returns the reaction to a hotplug event. While no panel is connected the CRTC stays on: a panel
/// that is only switched off and on then needs no modeset.
PanelGuard::Advice PanelGuard::heed(const PanelNews& news) {
  const ConnectorInfo* const connector = news.connector ? &*news.connector : nullptr;
  const PanelState state = judge_panel(connector, request_, output_.pipe().mode);
  const PanelState before = counters_.panel.exchange(state, std::memory_order_relaxed);
  switch (state) {
    case PanelState::Disconnected:
      return Advice::GoOn;
    case PanelState::Unreadable:
    case PanelState::ModeMissing:
      look_again();
      return Advice::GoOn;
    case PanelState::WrongPanel:
      return Advice::GoDark;
    case PanelState::Showing:
      break;
  }
  if (connector->link_bad) counters_.links_bad.add();
  const bool relight = before != PanelState::Showing || connector->link_bad;
  output_.update_connector(*connector);
  return relight ? Advice::Relight : Advice::GoOn;
}

}  // namespace lenticule::display
