// SPDX-License-Identifier: Apache-2.0
// Frames on real glass, through the kernel's atomic modesetting: docs/kms.md.
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <string>

#include "display/clock.h"
#include "display/display.h"
#include "display/kms/color/exactness_report.h"
#include "display/kms/device/platform.h"
#include "display/kms/device/session.h"
#include "display/kms/probe/output_wish.h"
#include "display/kms/scanout/handover.h"

namespace lenticule::display {

enum class ExitPolicy {
  Restore,  ///< put mode, picture and every property back
  Hold,     ///< leave the last frame to whoever holds the descriptor
  Black,    ///< switch the output off
};

/// What a player before us left: see handover.h.
struct InheritedOutput {
  UniqueFd card;
  HandoverState state;
};

struct KmsOptions {
  OutputWish wish;
  /// The panel's preferred mode if none.
  std::optional<frames::Rate> refresh;
  int buffers = 3;  ///< 2 ... 4; fewer if the card has no more memory
  ExitPolicy exit = ExitPolicy::Restore;
  /// Nothing is taken over: neither inherited buffers (an inherited card still is, being master)
  /// nor a mode that runs already.
  bool fresh = false;
  /// Shown even where it is known that subpixels arrive changed.
  bool allow_inexact = false;
  /// Used once, by the opening.
  std::shared_ptr<InheritedOutput> inherited;

  /// The real ones when null.
  std::shared_ptr<Clock> clock;
  std::shared_ptr<Session> session;
  std::shared_ptr<KmsPlatform> platform;
};

enum class PanelState {
  Showing,
  Disconnected,  ///< flips go on, nobody sees them
  Unreadable,    ///< connected, but who it is cannot be told yet
  ModeMissing,   ///< it does not offer our mode at the moment; held, looked at again
  WrongPanel,    ///< not the one that the rig was made for: the output is off, the display Lost
};
[[nodiscard]] const char* panel_state_name(PanelState state);

/// Monotonic counts since opening.
struct KmsStatistics {
  uint64_t flips = 0;
  uint64_t busy = 0;           ///< EBUSY
  uint64_t denied = 0;         ///< EACCES, EPERM
  uint64_t refused = 0;        ///< EINVAL, ENOENT, ENOSPC, ERANGE and others
  uint64_t flip_timeouts = 0;  ///< flips whose event did not come
  uint64_t stray_events = 0;   ///< duplicate, stale or somebody else's
  uint64_t truncated_reads = 0;
  uint64_t recoveries = 0;  ///< successful ones
  uint64_t modesets = 0;    ///< after the first picture
  uint64_t hotplugs = 0;    ///< changes of the connector that were looked at
  uint64_t links_bad = 0;
  uint64_t suspends = 0;
  uint64_t pauses = 0;
  uint64_t lost_ticks = 0;  ///< vblank events that did not come
  PanelState panel = PanelState::Showing;
  bool hardware_clock = false;
};

/// Threads as for Display; statistics() and exactness() from any thread.
///
/// Recovery happens inside wait_event() and request nothing of the caller: a flip that was accepted
/// gets its event, late perhaps. A modeset may take seconds there. After Lost, reconnect().
class KmsDisplay : public Display {
 public:
  /// Opens again after Lost, by the same wish, exact or not; buffers from before are void. Throws
  /// Error as open_kms_display() does; the card is closed then, and it may be called again. Nobody
  /// else may use the display. While another process holds a copy of card_fd(), that one may stay
  /// master.
  virtual void reconnect() = 0;
  [[nodiscard]] virtual KmsStatistics statistics() const noexcept = 0;
  /// Renewed every few seconds, and soon after a change that the kernel tells of.
  [[nodiscard]] virtual ExactnessReport exactness() const = 0;
  /// True if the first picture needed no modeset.
  [[nodiscard]] virtual bool took_over() const noexcept = 0;

  /// For the next player: the card (borrowed, to be duplicated) and what to tell about it.
  [[nodiscard]] virtual int card_fd() const noexcept = 0;
  [[nodiscard]] virtual HandoverState handover() const noexcept = 0;
};

/// Throws Error(Device) when there is no such output, it is not ours to use or the driver refuses;
/// Error(Quality) when it would change subpixels and that was not allowed; Error(Input) when the
/// panel is not the rig's, or has no such mode. Both list what there is.
[[nodiscard]] std::unique_ptr<KmsDisplay> open_kms_display(const KmsOptions& options);

}  // namespace lenticule::display
