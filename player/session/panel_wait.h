// SPDX-License-Identifier: Apache-2.0
// How a player comes by its panel, at the start and whenever the display is lost: it tries, and
// tries again as long as it may. A panel that is there instead shows a test card meanwhile.
#pragma once

#include <functional>
#include <memory>
#include <optional>
#include <string>

#include "base/error.h"
#include "display/kms/scanout/kms_display.h"
#include "display/kms/survey/panel_search.h"
#include "player/playback/playback.h"
#include "player/session/panel_card.h"

namespace lenticule::player {

/// A round of waiting.
struct PanelWaiting {
  /// What keeps the panel from being opened.
  const Error& reason;
  /// The panel that is wanted is not there. Otherwise it is, and cannot be opened.
  bool panel_missing = false;
  bool card_shown = false;
};

struct PanelWaitOptions {
  /// Whatever is null of clock and session is made. `inherited` is used once.
  display::KmsOptions kms;
  /// How long, at the start and after a loss; none = for ever, zero = not at all.
  std::optional<display::Nanoseconds> at_start;
  std::optional<display::Nanoseconds> after_loss;
  /// Of the rig's file, for the card.
  std::string rig;
  /// Readable = stop waiting; -1 = never.
  int cancel_fd = -1;
  /// After every round, about once a second; null = nobody wants to know.
  std::function<void(const PanelWaiting&)> tell = nullptr;
  /// Whatever others hold of the display is void: they would stay master of its card.
  std::function<void()> let_go = nullptr;
};

/// One thread, which uses no display that it has handed out.
class PanelWait {
 public:
  explicit PanelWait(PanelWaitOptions options);

  /// Throws Error as open_kms_display() does when the time is up, and Error(Device) when it is
  /// cancelled. Without waiting it tries once. `meanwhile` is called after every round.
  [[nodiscard]] std::unique_ptr<display::KmsDisplay> open(
      const std::function<void()>& meanwhile = nullptr);

  /// For PlaybackOptions::bring_back, with a display that open() returned. A display that is lost
  /// again right after it came back has no more time than it had the first time.
  [[nodiscard]] Comeback bring_back(display::KmsDisplay& display, const LostDisplay& lost);

  /// Why the last bring_back() gave up.
  [[nodiscard]] const std::optional<Error>& refusal() const { return refusal_; }

 private:
  using Attempt = std::function<void()>;

  void try_until(display::Nanoseconds give_up, const Attempt& attempt,
                 const std::function<void()>& meanwhile);
  [[nodiscard]] bool succeeds(const Attempt& attempt);
  void show_card(const display::PanelSearch& search);
  /// True if there is news of panels.
  bool rest(display::Nanoseconds duration);
  [[nodiscard]] display::Nanoseconds now() const { return options_.kms.clock->now(); }
  [[nodiscard]] bool cancelled() const;

  PanelWaitOptions options_;
  PanelCard card_;
  std::optional<Error> refusal_;
  display::Nanoseconds lost_since_{0};
  std::optional<display::Nanoseconds> back_since_;
};

}  // namespace lenticule::player
