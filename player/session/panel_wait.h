// SPDX-License-Identifier: Apache-2.0
// PanelWait opens the player's panel at the start, and again whenever the display is lost. It
// retries until its timeout. Meanwhile another connected panel shows a test card.
#pragma once

#include <functional>
#include <memory>
#include <optional>
#include <string>

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
  explicit PanelWait(PanelWaitOptions options);

  /// Opens the panel. Throws Error as open_kms_display() does when the timeout expires, and
  /// Error(Device) when cancelled. With a zero timeout it tries once. `meanwhile` is called after
  /// every attempt.
  [[nodiscard]] std::unique_ptr<display::KmsDisplay> open(
      const std::function<void()>& meanwhile = nullptr);

  /// Reconnects a display that open() returned; for PlaybackOptions::reconnect. A display that is
  /// lost again right after it came back shares the timeout of the first loss.
  [[nodiscard]] ReconnectResult reconnect(display::KmsDisplay& display, const LostDisplay& lost);

  /// Returns the reason why the last reconnect() gave up.
  [[nodiscard]] const std::optional<Error>& refusal() const { return refusal_; }

 private:
  using Attempt = std::function<void()>;

  void try_until(display::Nanoseconds give_up, const Attempt& attempt,
                 const std::function<void()>& meanwhile);
  [[nodiscard]] bool succeeds(const Attempt& attempt);
  void show_card(const display::PanelSearch& search);
  /// Waits. Returns true after a hotplug event.
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
