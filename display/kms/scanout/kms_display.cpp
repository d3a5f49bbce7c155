// SPDX-License-Identifier: Apache-2.0
#include "display/kms/scanout/kms_display.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cstring>
#include <utility>

#include "base/error.h"
#include "display/kms/device/drm_events.h"
#include "display/kms/device/drm_properties.h"
#include "display/kms/scanout/active_output.h"
#include "display/kms/scanout/kms_output.h"
#include "display/kms/scanout/page_flip.h"
#include "display/kms/scanout/panel_monitor.h"
#include "display/scanout_format.h"
#include "optics/rig.h"

namespace lenticule::display {
namespace {

bool plausible(const TakeoverState& state) {
  const auto side = [](int32_t pixels) { return pixels >= 1 && pixels <= optics::kMaxPanelPixels; };
  if (!side(state.width) || !side(state.height)) return false;
  if (state.buffer_count < kMinScanoutBuffers || state.buffer_count > kMaxScanoutBuffers)
    return false;
  if (state.bits != 8 && state.bits != 10) return false;
  if (state.connector == 0 || state.crtc == 0 || state.plane == 0) return false;
  if (std::find(state.card.begin(), state.card.end(), '\0') == state.card.end()) return false;
  return std::all_of(state.buffers.begin(), state.buffers.begin() + state.buffer_count,
                     [&](const TakeoverState::Buffer& buffer) {
                       const uint64_t row = uint64_t{4} * static_cast<uint64_t>(state.width);
                       constexpr uint64_t kMostBytes = uint64_t{1} << 33;
                       return buffer.handle != 0 && buffer.framebuffer != 0 &&
                              buffer.pitch >= row && buffer.size <= kMostBytes &&
                              buffer.size >=
                                  uint64_t{buffer.pitch} * static_cast<uint64_t>(state.height);
                     });
}

}  // namespace

std::optional<TakeoverState> parse_takeover_state(std::span<const uint8_t> bytes) {
  TakeoverState state;
  if (bytes.size() != sizeof(state)) return std::nullopt;
  std::memcpy(&state, bytes.data(), sizeof(state));
  if (state.magic != TakeoverState::kMagic || state.version != TakeoverState::kVersion)
    return std::nullopt;
  if (!plausible(state)) return std::nullopt;
  return state;
}

std::span<const uint8_t> bytes_of(const TakeoverState& state) {
  return {reinterpret_cast<const uint8_t*>(&state), sizeof(state)};
}

void discard_buffers(int fd, const TakeoverState& state) noexcept {
  for (uint32_t i = 0; i < std::min<uint32_t>(state.buffer_count, kMaxScanoutBuffers); ++i) {
    drmModeRmFB(fd, state.buffers[i].framebuffer);
    drmModeDestroyDumbBuffer(fd, state.buffers[i].handle);
  }
}

namespace {

constexpr Nanoseconds kSleepNoticed = std::chrono::milliseconds(500);

KmsOptions with_services(KmsOptions options) {
  if (!options.clock) options.clock = make_monotonic_clock();
  if (!options.session) options.session = make_direct_session();
  if (!options.platform) options.platform = make_linux_platform();
  return options;
}

void check_options(const KmsOptions& options) {
  if (options.output.panel.format != frames::PixelFormat::Rgb8)
    throw Error(ErrorKind::Usage, "kms: only 8-bit RGB frames can be shown");
  if (options.buffers < kMinScanoutBuffers || options.buffers > kMaxScanoutBuffers)
    throw Error(ErrorKind::Usage, fmt::format("kms: {} scan-out buffers", options.buffers),
                fmt::format("use {} to {}", kMinScanoutBuffers, kMaxScanoutBuffers));
}

/// AtomicKmsDisplay combines an active output, the handler of its page flips, the monitor of its
/// panel, and the waiter for all of their descriptors.
class AtomicKmsDisplay final : public KmsDisplay {
 public:
  explicit AtomicKmsDisplay(KmsOptions options)
      : options_(std::move(options)), clock_(options_.clock) {
    open();
  }
  ~AtomicKmsDisplay() override { close(options_.exit); }
  AtomicKmsDisplay(const AtomicKmsDisplay&) = delete;
  AtomicKmsDisplay& operator=(const AtomicKmsDisplay&) = delete;

  [[nodiscard]] const DisplayMode& mode() const override { return mode_; }
  [[nodiscard]] Nanoseconds now() const noexcept override { return clock_->now(); }

  [[nodiscard]] ScanoutBuffer* acquire() override {
    for (const auto& buffer : active_.buffers)
      if (buffer->try_acquire()) return buffer.get();
    return nullptr;
  }

  void discard(ScanoutBuffer* buffer) override { owned(buffer)->set_state(ScanoutState::Free); }

  [[nodiscard]] SubmitStatus submit(ScanoutBuffer* buffer, uint64_t id) noexcept override {
    KmsBuffer* const mine = owned(buffer);
    return flips_ ? flips_->submit(mine, id) : SubmitStatus::Lost;
  }
  [[nodiscard]] bool request_vblank(uint64_t sequence) noexcept override {
    return flips_ && flips_->request_vblank(sequence);
  }
  [[nodiscard]] DisplayEvent wait_event(Nanoseconds deadline, int wake_fd) noexcept override {
    if (!flips_) return {.kind = EventKind::Lost};
    for (bool over = false;;) {
      if (!flips_->lost()) run_timers();
      if (const auto event = flips_->take_event()) return *event;
      if (flips_->lost()) return {.kind = EventKind::Lost};
      if (over) return {.kind = EventKind::Timeout};
      const Nanoseconds next = std::min({deadline, flips_->next_due(), monitor_->next_due()});
      const ReadySet ready = waiter_->wait(*clock_, next, wake_fd);
      notice_sleep();
      handle(ready);
      over = ready.wake || now() >= deadline;
    }
  }

  [[nodiscard]] bool set_power(bool on) noexcept override {
    return flips_ && flips_->set_power(on);
  }

  void reconnect() override {
    close(ExitPolicy::Black);  // not Hold: the holder of the card would remain its master
    open();
  }
  [[nodiscard]] KmsStatistics statistics() const noexcept override {
    KmsStatistics statistics = counters_.snapshot();
    statistics.one_commit = !active_.output || active_.output->flips_jointly();
    return statistics;
  }

  [[nodiscard]] ExactnessReport exactness() const override {
    return active_.output ? active_.output->report() : ExactnessReport{};
  }
  [[nodiscard]] bool took_over() const noexcept override {
    return active_.output && active_.output->took_over();
  }
  [[nodiscard]] int card_fd() const noexcept override {
    return active_.output ? active_.output->device().fd() : -1;
  }
  [[nodiscard]] TakeoverState takeover_state() const noexcept override {
    if (!active_.output) return {};
    TakeoverState state = takeover_state_of(active_, options_.output.panel);
    state.off = counters_.off.load(std::memory_order_relaxed) ? 1 : 0;
    return state;
  }

 private:
  void open() {
    try {
      start();
    } catch (...) {
      close(options_.exit);
      throw;
    }
  }

  void start() {
    active_ = open_output(options_);
    options_.previous.reset();
    active_.front->set_state(ScanoutState::Displayed);
    try {
      require_exact(options_, *active_.output);
    } catch (...) {
      close(ExitPolicy::Restore);  // a refused picture is not kept
      throw;
    }
    // Reconnecting after a successful start tolerates inexact output and reports it instead of
    // stopping.
    options_.allow_inexact = true;
    const Pipe& pipe = active_.output->pipe();
    const DrmDevice& device = active_.output->device();
    mode_ = {.geometry = turned(options_.output.panel, options_.mounting),
             .refresh = refresh_of(pipe.mode),
             .name = fmt::format("{} on {} {}{}", active_.output->name(), device.path(),
                                 to_string(pipe.mode), depth_suffix(pipe.depth)),
             .panel = panel_names(),
             .hardware_clock = false};
    asleep_ = options_.platform->time_asleep();
    flips_.emplace(active_, options_.session, clock_, mode_.refresh, counters_);
    monitor_.emplace(*active_.output, options_.output, options_.platform->watch_hotplug(), clock_,
                     counters_);
    waiter_.emplace(device.fd(), options_.session->fd(), monitor_->fd());
    mode_.hardware_clock = flips_->counts_by_hardware();
    // The kernel takes the panel when the console returns to text mode, even if a process holds the
    // card. A held frame therefore must not use the console.
    if (options_.exit != ExitPolicy::Hold) console_.emplace(options_.platform->terminal());
  }

  /// Returns the identity of the panel, or the names of a wall's panels.
  [[nodiscard]] std::string panel_names() const {
    std::vector<std::string> names;
    for (const OutputPart& part : options_.output.parts) names.push_back(part.name);
    if (!names.empty()) return fmt::format("{}", fmt::join(names, " and "));
    const auto& identity = active_.output->pipe().connector.edid.identity;
    return identity ? to_string(*identity) : active_.output->name() + " without EDID";
  }

  void close(ExitPolicy exit) noexcept {
    const bool lost = flips_ && flips_->lost();
    waiter_.reset();
    monitor_.reset();
    flips_.reset();
    if (active_.output) {
      if (!lost) leave_output(exit);
      active_.front = nullptr;
      active_.buffers.clear();
      const DrmDevice& device = active_.output->device();
      if (exit != ExitPolicy::Hold) device.session().drop_master(device.fd());
      active_.output.reset();
    }
    console_.reset();  // the console may draw again once the card is free
  }

  /// Leaves the output. A framebuffer is never removed while it is displayed.
  void leave_output(ExitPolicy exit) noexcept {
    switch (exit) {
      case ExitPolicy::Restore:
        (void)active_.output->restore();
        return;
      case ExitPolicy::Black:
        (void)active_.output->blank();
        return;
      case ExitPolicy::Hold:
        for (const auto& buffer : active_.buffers) buffer->abandon();
    }
  }

  void run_timers() noexcept {
    follow_panel(false);
    flips_->run_timers();
    if (flips_->take_panel_check()) monitor_->check_now();
  }

  void handle(const ReadySet& ready) noexcept {
    if (ready.card) flips_->read_events();
    if (ready.card_gone) flips_->mark_lost();
    if (ready.session) flips_->set_session_ours(options_.session->dispatch());
    follow_panel(ready.hotplug);
    // Written only when it changes, because other threads may read the mode at any time.
    if (mode_.hardware_clock && !flips_->counts_by_hardware()) mode_.hardware_clock = false;
  }

  void follow_panel(bool event_waiting) noexcept {
    switch (monitor_->handle_events(event_waiting)) {
      case PanelMonitor::Action::None:
        return;
      case PanelMonitor::Action::SetMode:
        return flips_->request_modeset();
      case PanelMonitor::Action::SwitchOff:
        (void)active_.output->blank();
        return flips_->mark_lost();
    }
  }

  /// Detects that the machine was suspended, which loses pending flips and leaves links in an
  /// unknown state.
  void notice_sleep() noexcept {
    const Nanoseconds asleep = options_.platform->time_asleep();
    const bool slept = asleep > asleep_ + kSleepNoticed;
    asleep_ = asleep;
    if (!slept) return;
    counters_.suspends.add();
    monitor_->check_now();
    flips_->request_modeset();
  }

  static KmsBuffer* owned(ScanoutBuffer* buffer) noexcept {
    auto* const mine = static_cast<KmsBuffer*>(buffer);
    LENTICULE_CHECK(mine != nullptr && mine->state() == ScanoutState::Acquired);
    return mine;
  }

  KmsOptions options_;
  std::shared_ptr<Clock> clock_;
  KmsCounters counters_;
  DisplayMode mode_;
  ActiveOutput active_;
  // These exist only while the output is active; they refer to it.
  std::optional<PageFlipHandler> flips_;
  std::optional<PanelMonitor> monitor_;
  std::optional<EventWaiter> waiter_;
  std::optional<GraphicsConsole> console_;
  Nanoseconds asleep_{0};
};

}  // namespace

std::unique_ptr<KmsDisplay> open_kms_display(const KmsOptions& options) {
  check_options(options);
  return std::make_unique<AtomicKmsDisplay>(with_services(options));
}

}  // namespace lenticule::display
