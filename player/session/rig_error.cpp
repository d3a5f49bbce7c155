// SPDX-License-Identifier: Apache-2.0
#include "player/session/rig_error.h"

#include <poll.h>

#include "base/error.h"
#include "display/kms/inspect.h"
#include "player/process/interrupt.h"
#include "player/session/card_texts.h"
#include "player/session/panel_card.h"

namespace lenticule::player {
namespace {

using display::Nanoseconds;

constexpr Nanoseconds kTryAgain = std::chrono::seconds(5);

/// Returns options that accept any panel that the display's name allows.
display::KmsOptions any_panel(const std::string& spec, display::KmsOptions options) {
  options.output = display::parse_kms_spec(spec, options.output);
  options.output.policy = display::IdentityPolicy::Ignore;
  options.exit = display::ExitPolicy::Black;
  if (!options.clock) options.clock = display::make_monotonic_clock();
  if (!options.session) options.session = display::make_direct_session();
  return options;
}

class ErrorOnAnyPanel {
 public:
  ErrorOnAnyPanel(const PlayFlags& flags, const display::KmsOptions& services)
      : options_(any_panel(flags.display, services)), card_(options_) {}

  void show(const display::CardText& text) {
    const display::PanelSearch search = search_panel(options_, card_.display());
    if (search.present.empty() || !card_.show(search.present.front(), text)) card_.close();
  }
  /// Waits until the next attempt is due, or until interrupted.
  void wait() {
    const Nanoseconds until = options_.clock->now() + kTryAgain;
    if (card_.display() != nullptr)
      (void)card_.wait(until, interrupt_fd());
    else
      (void)options_.clock->wait_until(until, interrupt_fd());
  }

 private:
  display::KmsOptions options_;
  PanelCard card_;
};

}  // namespace

std::optional<PlayPlan> plan_when_rig_is_right(const PlayFlags& flags,
                                               const ServiceManager& manager,
                                               const display::KmsOptions& services) {
  std::optional<ErrorOnAnyPanel> shown;
  while (!interrupted()) {
    try {
      return make_plan(flags, manager.present());
    } catch (const Error& error) {
      if (error.kind() == ErrorKind::Usage || !display::is_kms_spec(flags.display)) throw;
      if (!shown) shown.emplace(flags, services);
      manager.status(std::string("test card shown: ") + error.what());
      shown->show(error_card(flags.rig_or_wall(), error));
    }
    shown->wait();
  }
  return std::nullopt;
}

}  // namespace lenticule::player
