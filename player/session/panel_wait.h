// SPDX-License-Identifier: Apache-2.0
// PanelWait opens the player's panel at the start, and again whenever the display is lost. It
// retries until its timeout. Meanwhile another connected panel shows a test card.
#pragma once

#include <poll.h>

#include <algorithm>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <utility>

#include "base/error.h"
#include "display/kms/inspect.h"
#include "display/kms/scanout/kms_display.h"
#include "player/playback/playback.h"
#include "player/session/panel_card.h"

namespace lenticule::player {

/// The state after one attempt.
struct PanelWaiting {
  /// The reason why the panel could not be opened.
  const Error& reason;
  /// True if the requested panel is not connected; false if it is connected and cannot be opened.
  bool panel_missing = false;
  bool card_shown = false;
};

struct PanelWaitOptions {
  /// A clock or session that is null is created. `previous` is used once.
  display::KmsOptions kms;
  /// Timeouts at the start and after a loss; none = wait forever, zero = do not wait.
  std::optional<display::Nanoseconds> at_start;
  std::optional<display::Nanoseconds> after_loss;
  /// Name of the rig's file, for the card.
  std::string rig;
  /// Readable = stop waiting; -1 = never.
  int cancel_fd = -1;
  /// Called after every attempt, about once a second; may be null.
  std::function<void(const PanelWaiting&)> report = nullptr;
  /// Called before the card is reopened: must release every copy of its descriptor (systemd's fd
  /// store), since a holder would stay DRM master.
  std::function<void()> release_stored = nullptr;
};

/// Thread safety: one thread, which does not use a display returned by open() while waiting.
class PanelWait {
 public:
  explicit PanelWait(PanelWaitOptions options)
      : options_(complete(std::move(options))), card_(for_cards(options_.kms)) {}

  /// Opens the panel. Throws Error as open_kms_display() does when the timeout expires, and
  /// Error(Device) when cancelled. With a zero timeout it tries once. `meanwhile` is called after
  /// every attempt.
  [[nodiscard]] std::unique_ptr<display::KmsDisplay> open(
      const std::function<void()>& meanwhile = nullptr) {
    std::unique_ptr<display::KmsDisplay> opened;
    try_until(
        later(now(), options_.at_start),
        [&] {
          // Cleared before the attempt, because a previous output can be used only once, successful
          // or not.
          display::KmsOptions options = options_.kms;
          options_.kms.previous.reset();
          opened = display::open_kms_display(options);
        },
        meanwhile);
    return opened;
  }

  /// Reconnects a display that open() returned; for PlaybackOptions::reconnect. A display that is
  /// lost again right after it came back shares the timeout of the first loss.
  [[nodiscard]] ReconnectResult reconnect(display::KmsDisplay& display, const LostDisplay& lost) {
    const bool was_sound = !back_since_ || now() >= *back_since_ + kSound;
    if (was_sound) lost_since_ = now();
    const Nanoseconds out_of_time = later(now(), lost.time_left);
    const Nanoseconds give_up = std::min(later(lost_since_, options_.after_loss), out_of_time);
    if (options_.release_stored) options_.release_stored();
    try {
      if (!was_sound) (void)rest(kRound);
      if (now() >= give_up)
        throw Error(ErrorKind::Device, "kms: the panel is lost repeatedly",
                    "'lenticule doctor' tests this output");
      try_until(
          give_up, [&] { display.reconnect(); }, lost.serve_source);
    } catch (const Error& error) {
      refusal_ = error;
      if (cancelled()) return ReconnectResult::Stopped;
      return now() >= out_of_time ? ReconnectResult::TimeOver : ReconnectResult::GivenUp;
    }
    back_since_ = now();
    return ReconnectResult::Reconnected;
  }

  /// Returns the reason why the last reconnect() gave up.
  [[nodiscard]] const std::optional<Error>& refusal() const { return refusal_; }

 private:
  using Nanoseconds = display::Nanoseconds;
  using PanelSearch = display::PanelSearch;
  static constexpr Nanoseconds kForEver = Nanoseconds::max();
  /// Time between two attempts, each of which probes every panel.
  static constexpr Nanoseconds kRound = std::chrono::seconds(1);
  /// A panel that wakes up may appear to be another one for this long.
  static constexpr Nanoseconds kCardAfter = std::chrono::seconds(2);
  /// A display that shows a card reports hotplug events; probing is only a precaution.
  static constexpr int kRoundsPerLook = 10;
  /// A display that worked for this long counts as recovered.
  static constexpr Nanoseconds kSound = std::chrono::seconds(10);

  /// Returns options for a test card: a card is not left on the panel for a successor.
  static display::KmsOptions for_cards(display::KmsOptions options) {
    if (options.exit == display::ExitPolicy::Hold) options.exit = display::ExitPolicy::Black;
    options.allow_inexact = true;  // text is readable even if colours are inexact
    return options;
  }

  static PanelWaitOptions complete(PanelWaitOptions options) {
    if (!options.kms.clock) options.kms.clock = display::make_monotonic_clock();
    if (!options.kms.session) options.kms.session = display::make_direct_session();
    return options;
  }

  static Nanoseconds later(Nanoseconds now, std::optional<Nanoseconds> duration) {
    return duration && *duration < kForEver - now ? now + *duration : kForEver;
  }

  struct CardOff {
    void operator()(PanelCard* card) const { card->close(); }
  };
  using Attempt = std::function<void()>;

  /// Tries at once, and then whenever the requested panel seems to be connected. Removes the card
  /// when it returns.
  void try_until(display::Nanoseconds give_up, const Attempt& attempt,
                 const std::function<void()>& meanwhile) {
    const std::unique_ptr<PanelCard, CardOff> card_off(&card_);
    const Nanoseconds card_from = now() + kCardAfter;
    PanelSearch search{.found = true};
    int rounds_to_look = 0;
    while (true) {
      if (search.found && succeeds(attempt)) return;
      if (now() >= give_up) throw Error(*refusal_);
      const bool was_found = search.found;
      if (card_.display() == nullptr || rounds_to_look-- <= 0) {
        search = search_panel(options_.kms, card_.display());
        rounds_to_look = kRoundsPerLook;
      }
      if (search.found && !was_found) continue;
      if (!search.found) refusal_ = search.refusal;
      if (!search.found && !search.may_come && give_up != kForEver) throw Error(*refusal_);
      if (now() >= card_from) show_card(search);
      if (meanwhile) meanwhile();
      if (options_.report)
        options_.report({.reason = *refusal_,
                         .panel_missing = !search.found,
                         .card_shown = card_.display() != nullptr});
      if (rest(std::min(kRound, give_up - now()))) rounds_to_look = 0;
    }
  }
  [[nodiscard]] bool succeeds(const Attempt& attempt) {
    card_.close();
    try {
      attempt();
      return true;
    } catch (const Error& error) {
      refusal_ = error;
      if (options_.release_stored) options_.release_stored();
      // The panel is connected and the driver alters pixel values; waiting would not help.
      if (error.kind() == ErrorKind::Quality) throw;
      return false;
    }
  }
  void show_card(const display::PanelSearch& search) {
    if (search.found || search.present.empty()) return card_.close();
    const display::PanelInfo& panel = search.present.front();
    (void)card_.show(panel, wrong_panel_card(options_.kms.output, search, panel, options_.rig));
  }
  /// Waits. Returns true after a hotplug event.
  /// Throws Error(Device) when cancelled.
  bool rest(display::Nanoseconds duration) {
    const bool news = card_.wait(now() + duration, options_.cancel_fd);
    if (cancelled()) throw Error(ErrorKind::Device, "kms: interrupted while waiting for a panel");
    return news;
  }
  [[nodiscard]] display::Nanoseconds now() const { return options_.kms.clock->now(); }
  [[nodiscard]] bool cancelled() const {
    pollfd entry{.fd = options_.cancel_fd, .events = POLLIN, .revents = 0};
    return options_.cancel_fd >= 0 && poll(&entry, 1, 0) > 0;
  }

  PanelWaitOptions options_;
  PanelCard card_;
  std::optional<Error> refusal_;
  display::Nanoseconds lost_since_{0};
  std::optional<display::Nanoseconds> back_since_;
};

}  // namespace lenticule::player
