// SPDX-License-Identifier: Apache-2.0
// KmsDisplay shows frames on a panel through the kernel's atomic modesetting. See docs/play/kms.md.
#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <type_traits>

#include "display/clock.h"
#include "display/display.h"
#include "display/kms/color/exactness_report.h"
#include "display/kms/device/platform.h"
#include "display/kms/probe/output_request.h"
#include "optics/panel.h"

namespace lenticule::display {

inline constexpr int kMinScanoutBuffers = 2;
inline constexpr int kMaxScanoutBuffers = 4;

/// TakeoverState is the state that a player passes to the next one together with the card's
/// descriptor, so that the last frame stays displayed and the next one needs no modeset.
/// Plain bytes, for a sealed memory file. Object ids belong to the open descriptor, not to the
/// process that created the objects.
struct TakeoverState {
  static constexpr uint64_t kMagic = 0x3144'4e41'484c'4bff;
  static constexpr uint32_t kVersion = 2;

  uint64_t magic = kMagic;
  uint32_t version = kVersion;
  uint32_t connector = 0;
  uint32_t crtc = 0;
  uint32_t plane = 0;
  int32_t width = 0;
  int32_t height = 0;
  uint32_t buffer_count = 0;
  uint32_t off = 0;   ///< 1: the output was switched off on request
  uint32_t bits = 8;  ///< bits per colour of the buffers: 8 or 10
  uint32_t reserved = 0;
  /// The kernel's ids of a scan-out buffer, and its size.
  struct Buffer {
    uint32_t handle = 0;
    uint32_t framebuffer = 0;
    uint32_t pitch = 0;
    uint32_t reserved = 0;
    uint64_t size = 0;
    friend bool operator==(const Buffer&, const Buffer&) = default;
  };
  std::array<Buffer, kMaxScanoutBuffers> buffers{};
  std::array<char, 64> edid_sha256{};  ///< checksum of the panel's EDID, zeros if it has none
  std::array<char, 64> card{};         ///< path of the card's node, zero-terminated

  friend bool operator==(const TakeoverState&, const TakeoverState&) = default;
};
static_assert(std::is_trivially_copyable_v<TakeoverState>);

/// Returns the state; none unless the bytes are a state of this version and every number is
/// plausible.
[[nodiscard]] std::optional<TakeoverState> parse_takeover_state(std::span<const uint8_t> bytes);
[[nodiscard]] std::span<const uint8_t> bytes_of(const TakeoverState& state);

/// Frees every buffer in the state, if the state is not taken over.
void discard_buffers(int fd, const TakeoverState& state) noexcept;

enum class ExitPolicy {
  Restore,  ///< restore mode, picture and every property
  Hold,     ///< leave the last frame to the process that holds the descriptor
  Black,    ///< switch the output off
};

/// The output of the previous player, to be taken over.
struct PreviousOutput {
  UniqueFd card;
  TakeoverState state;
};

struct KmsOptions {
  OutputRequest output;
  optics::Mounting mounting;  ///< frames are what the viewer sees of output.panel
  int buffers = 3;            ///< 2 ... 4; fewer if the card has too little memory
  ExitPolicy exit = ExitPolicy::Restore;
  /// Takes over neither buffers nor a running mode. The card of the previous player is still used,
  /// because its descriptor is DRM master.
  bool fresh = false;
  /// Shows frames even if the driver or the link is known to alter subpixels.
  bool allow_inexact = false;
  /// Used once, when the display is opened.
  std::shared_ptr<PreviousOutput> previous;

  /// Null = the real ones.
  std::shared_ptr<Clock> clock;
  std::shared_ptr<Session> session;
  std::shared_ptr<KmsPlatform> platform;
};

enum class PanelState {
  Showing,
  Disconnected,  ///< flips continue, without a visible picture
  Unreadable,    ///< connected, and its identity cannot be read yet
  ModeMissing,  ///< the panel does not offer the mode at the moment; the output is kept and checked
                ///< again
  WrongPanel,   ///< another panel than the rig's: the output is off, the display Lost
};

[[nodiscard]] inline const char* panel_state_name(PanelState state) {
  constexpr const char* kNames[] = {"showing", "disconnected", "unreadable", "mode missing",
                                    "wrong panel"};
  return kNames[static_cast<size_t>(state)];
}

/// Monotonic counts since the display was opened.
struct KmsStatistics {
  uint64_t flips = 0;
  uint64_t busy = 0;           ///< EBUSY
  uint64_t denied = 0;         ///< EACCES, EPERM
  uint64_t refused = 0;        ///< EINVAL, ENOENT, ENOSPC, ERANGE and others
  uint64_t flip_timeouts = 0;  ///< flips without an event
  uint64_t stray_events = 0;   ///< duplicate, stale or unrelated events
  uint64_t truncated_reads = 0;
  uint64_t recoveries = 0;  ///< successful recoveries
  uint64_t modesets = 0;    ///< modesets after the first frame
  uint64_t hotplugs = 0;    ///< changes of the connector that were examined
  uint64_t links_bad = 0;
  uint64_t suspends = 0;
  uint64_t times_paused = 0;  ///< times another session took the card
  uint64_t lost_ticks = 0;    ///< vblank events that did not arrive
  /// Largest difference between the vblanks at which the connectors of an output began to show a
  /// frame.
  Nanoseconds largest_skew{0};
  PanelState panel = PanelState::Showing;
  bool hardware_clock = false;
  bool one_commit = true;  ///< one commit flips all connectors of the output
  bool off = false;        ///< switched off on request
};

/// Thread safety: as for Display; statistics() and exactness() from any thread.
///
/// wait_event() recovers from failures without the caller's help: an accepted flip always gets its
/// event, possibly late. A modeset there may take seconds. After Lost, call reconnect().
class KmsDisplay : public Display {
 public:
  /// Opens the display again after Lost, for the same request, exact or not; earlier buffers are
  /// invalid. No other thread may use the display. Throws Error as open_kms_display() does; the
  /// card is then closed, and reconnect() may be called again. Note that a process with a copy of
  /// card_fd() may remain DRM master.
  virtual void reconnect() = 0;
  [[nodiscard]] virtual KmsStatistics statistics() const noexcept = 0;
  /// Returns the report, which is updated every few seconds and soon after a change that the kernel
  /// reports.
  [[nodiscard]] virtual ExactnessReport exactness() const = 0;
  /// Returns true if the first frame needed no modeset.
  [[nodiscard]] virtual bool took_over() const noexcept = 0;

  /// Return, for the next player, the card's descriptor (borrowed, to be duplicated) and the state
  /// of the output.
  [[nodiscard]] virtual int card_fd() const noexcept = 0;
  [[nodiscard]] virtual TakeoverState takeover_state() const noexcept = 0;
};

/// Opens an output. Throws Error(Device) if there is no such output, it is not available or the
/// driver refuses; Error(Quality) if it would change subpixels and that is not allowed;
/// Error(Input) if the panel is not the rig's or lacks the mode. The first and the last list the
/// available panels or modes.
[[nodiscard]] std::unique_ptr<KmsDisplay> open_kms_display(const KmsOptions& options);

}  // namespace lenticule::display
