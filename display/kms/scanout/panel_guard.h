// SPDX-License-Identifier: Apache-2.0
// Follows the panel on a lit output: who is there now, whether it still offers our mode, and what
// its changes ask for.
#pragma once

#include <memory>

#include "display/clock.h"
#include "display/kms/probe/output_wish.h"
#include "display/kms/scanout/kms_counters.h"
#include "display/kms/scanout/kms_output.h"
#include "display/kms/scanout/panel_watch.h"

namespace lenticule::display {

/// What a panel means for frames in `mode` that are meant for `wish`. None: its connector is gone.
[[nodiscard]] PanelState judge_panel(const ConnectorInfo* connector, const OutputWish& wish,
                                     const drmModeModeInfo& mode);

/// One thread. The output is audited again while it is watched.
class PanelGuard {
 public:
  /// Borrows `output`, whose connector it keeps up to date, `wish` and `counters`.
  PanelGuard(KmsOutput& output, const OutputWish& wish, std::unique_ptr<HotplugMonitor> monitor,
             std::shared_ptr<Clock> clock, KmsCounters& counters);

  /// Readable when follow() has something to do; -1 if it never is.
  [[nodiscard]] int fd() const noexcept { return watch_.fd(); }
  /// When follow() wants to be called next.
  [[nodiscard]] Nanoseconds next_due() const noexcept;
  /// Look at the panel at once.
  void look() noexcept;

  enum class Advice {
    GoOn,
    Relight,  ///< it is back, its link must be trained again, or a property was changed
    GoDark,   ///< frames woven for another panel are wrong for every eye: better none
  };
  /// Hears the news and judges them.
  [[nodiscard]] Advice follow(bool news_waiting) noexcept;

 private:
  [[nodiscard]] Advice heed(const PanelNews& news);
  void look_again() noexcept;

  KmsOutput& output_;
  const OutputWish& wish_;
  std::shared_ptr<Clock> clock_;
  KmsCounters& counters_;
  PanelWatch watch_;
  Nanoseconds look_at_;
};

}  // namespace lenticule::display
