// SPDX-License-Identifier: Apache-2.0
#include "display/kms/scanout/kms_display.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <utility>

#include "base/error_kinds.h"
#include "display/kms/device/drm_events.h"
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

constexpr Nanoseconds kSleepNoticed = std::chrono::milliseconds(500);
constexpr int kBlockingCommitsBeforeModeset = 2;
constexpr Nanoseconds kShortestBackoff = std::chrono::milliseconds(50);
constexpr Nanoseconds kLongestBackoff = std::chrono::seconds(1);
constexpr Nanoseconds kFirstResume = std::chrono::milliseconds(100);
constexpr Nanoseconds kLongestResume = std::chrono::seconds(2);

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
    throw usage_error("kms: {} scan-out buffers", options.buffers)
        .remedy(fmt::format("use {} to {}", kMinScanoutBuffers, kMaxScanoutBuffers));
}

/// The reasons for which the kernel refuses a commit, by the reaction that each needs.
enum class CommitFailure {
  Busy,    ///< a commit is pending: try again later
  Denied,  ///< another process is DRM master at the moment: wait
  Gone,    ///< the card is gone
  Wrong,   ///< the output's state is not the expected one
};

/// Returns the class of `error`, a negative errno.
CommitFailure classify(int error) noexcept {
  switch (-error) {
    case EBUSY:
      return CommitFailure::Busy;
    case EACCES:
    case EPERM:
      return CommitFailure::Denied;
    case ENODEV:
    case EIO:
    case ENXIO:
    case EBADF:
      return CommitFailure::Gone;
    default:
      return CommitFailure::Wrong;
  }
}

/// PageFlipHandler flips frames on one active output. It repeats commits for which the kernel was
/// busy, replaces lost events by blocking commits and failed ones by modesets, and pauses while
/// another session owns the card or the output is switched off. Allocates memory only for modesets.
/// Thread safety: the presenter's thread.
class PageFlipHandler {
 public:
  /// Lifetime: `active`, whose front buffer the handler keeps up to date, and `counters` must
  /// outlive the handler.
  PageFlipHandler(ActiveOutput& active, std::shared_ptr<Session> session,
                  std::shared_ptr<Clock> clock, frames::Rate refresh, KmsCounters& counters)
      : active_(active),
        session_(std::move(session)),
        clock_(std::move(clock)),
        counters_(counters),
        vblanks_(*active.output, refresh, *clock_, counters),
        // The start value differs from the serial numbers of a previous user of the card.
        next_serial_(static_cast<uint64_t>(clock_->now().count()) | 1),
        tiles_(active.output->pipe_count()),
        backoff_(kShortestBackoff),
        resume_backoff_(kFirstResume) {}

  /// See Display::submit() and request_vblank().
  [[nodiscard]] SubmitStatus submit(KmsBuffer* buffer, uint64_t id) noexcept {
    if (lost_) return SubmitStatus::Lost;
    if (paused_ || off_ || flip_.phase() == PendingFlip::Phase::Stuck) return SubmitStatus::Paused;
    if (flip_.phase() != PendingFlip::Phase::None) return SubmitStatus::Busy;

    buffer->set_state(ScanoutState::Pending);
    flip_.queue(buffer, id);
    if (needs_modeset_)
      flip_.stick(recover_at_);
    else
      try_flip();
    if (!lost_ && !paused_) return SubmitStatus::Accepted;
    buffer->set_state(ScanoutState::Acquired);
    flip_.withdraw();
    return lost_ ? SubmitStatus::Lost : SubmitStatus::Paused;
  }
  [[nodiscard]] bool request_vblank(uint64_t sequence) noexcept {
    if (lost_) return false;
    vblanks_.request(sequence, next_serial_++, !paused_ && !off_);
    return true;
  }
  /// See Display::set_power(). Switching on is a modeset, with a new audit; if the kernel refuses
  /// it, it is tried again like any other. A modeset that is needed while the output is off waits.
  [[nodiscard]] bool set_power(bool on) noexcept {
    if (on != off_) return true;
    if (on) {
      off_ = false;
      request_modeset();
      if (!paused_ && !lost_) recover();
    } else {
      // While another session owns the card, the output is switched off when the card is back.
      if (lost_ || (!paused_ && active_.output->blank() != 0)) return false;
      off_ = true;
    }
    counters_.off = off_;
    return true;
  }
  /// Returns the next event that is due, one per call.
  [[nodiscard]] std::optional<DisplayEvent> take_event() noexcept {
    if (flip_.is_due(PendingFlip::Phase::Landed, now())) return deliver_flip();
    if (const auto tick = vblanks_.take_tick())
      return DisplayEvent{
          .kind = EventKind::Vblank, .sequence = tick->sequence, .time = tick->time};
    return std::nullopt;
  }

  /// Returns the time at which run_timers() or take_event() is due.
  [[nodiscard]] Nanoseconds next_due() const noexcept {
    Nanoseconds next = vblanks_.due();
    const bool flips = !paused_ && !off_;
    if (flip_.phase() == PendingFlip::Phase::Landed || flips) next = std::min(next, flip_.due());
    if (paused_) return std::min(next, resume_at_);
    if (only_modeset_pending()) next = std::min(next, recover_at_);
    return next;
  }
  void run_timers() noexcept {
    using enum PendingFlip::Phase;
    if (paused_ && now() >= resume_at_) try_resume();
    if (!paused_ && !off_ && !lost_) {
      if (flip_.is_due(Queued, now())) try_flip();
      if (flip_.is_due(Armed, now())) {
        ++counters_.flip_timeouts;
        flip_.stick(now());
      }
      if (flip_.is_due(Stuck, now()) || (only_modeset_pending() && now() >= recover_at_)) recover();
    }
    vblanks_.run_timers();
  }
  /// Call when the card's descriptor is readable.
  void read_events() noexcept {
    const EventRead result = read_drm_events(
        active_.output->device().fd(), [this](const DrmEvent& event) { on_drm_event(event); });
    if (result == EventRead::Truncated) ++counters_.truncated_reads;
    if (result == EventRead::Gone) mark_lost();
  }

  /// Requests a modeset, because the output may be in any state. The modeset also shows the pending
  /// flip, if there is one.
  void request_modeset() noexcept {
    needs_modeset_ = true;
    if (!paused_) recover_at(now());
  }
  /// Marks the display as lost: the card, or the right to use this panel, is gone permanently.
  void mark_lost() noexcept { lost_ = true; }
  [[nodiscard]] bool lost() const noexcept { return lost_; }
  [[nodiscard]] bool counts_by_hardware() const noexcept { return vblanks_.is_hardware(); }
  /// Returns true once after a failure that a change of the panel could explain: the panel should
  /// be checked.
  [[nodiscard]] bool take_panel_check() noexcept { return std::exchange(panel_check_due_, false); }

 private:
  void on_drm_event(const DrmEvent& event) noexcept {
    if (event.kind == DrmEvent::Kind::Flip) return on_flip_event(event);
    if (!vblanks_.observe(event)) ++counters_.stray_events;
  }
  void on_flip_event(const DrmEvent& event) noexcept {
    const bool expected = flip_.awaits(event.id) && note_tile(event);
    if (!expected) ++counters_.stray_events;
    if (!expected || !tiles_.complete()) return;
    recovery_attempts_ = 0;
    counters_.largest_skew = std::max(counters_.largest_skew.load(), tiles_.skew());
    land(vblanks_.place(tiles_.first()));
  }
  /// Adds the event of a flip of this output. Returns false for an event that does not belong to
  /// it.
  [[nodiscard]] bool note_tile(const DrmEvent& event) noexcept {
    const auto tile = active_.output->pipe_of_crtc(event.crtc);
    return tile && tiles_.add(*tile, event);
  }
  void try_flip() noexcept {
    const uint64_t serial = next_serial_++;
    tiles_.start();
    const int error = active_.output->flip(flip_.buffer()->framebuffer(), serial);
    if (error == 0) return flip_.arm(serial, now() + flip_timeout(vblanks_.period()));
    const CommitFailure failure = note_failure(error);
    if (failure == CommitFailure::Busy) flip_.put_off(now() + vblanks_.period());
    if (failure == CommitFailure::Wrong) flip_.stick(now());
  }
  void land(VblankClock::Landing landing) noexcept {
    flip_.land(landing.vblank, landing.report_at);
  }
  DisplayEvent deliver_flip() noexcept {
    const PendingFlip::Landed flip = flip_.deliver();
    if (active_.front != nullptr) active_.front->set_state(ScanoutState::Free);
    active_.front = flip.buffer;
    active_.front->set_state(ScanoutState::Displayed);
    ++counters_.flips;
    return {.kind = EventKind::Flip,
            .id = flip.id,
            .sequence = flip.vblank.sequence,
            .time = flip.vblank.time};
  }

  /// Counts a refusal and starts the reaction that it needs.
  CommitFailure note_failure(int error) noexcept {
    const CommitFailure failure = classify(error);
    switch (failure) {
      case CommitFailure::Busy:
        ++counters_.busy;
        break;
      case CommitFailure::Denied:
        ++counters_.denied;
        pause();
        break;
      case CommitFailure::Gone:
        mark_lost();
        break;
      case CommitFailure::Wrong:
        ++counters_.refused;
        needs_modeset_ = true;
        break;
    }
    return failure;
  }
  /// Recovers a flip whose event is missing. A blocking commit returns when the frame is displayed,
  /// so its success replaces the lost event. If blocking commits fail, a modeset is tried, and then
  /// again after growing pauses.
  void recover() noexcept {
    const bool modeset = needs_modeset_ || ++recovery_attempts_ > kBlockingCommitsBeforeModeset;
    const int error = modeset ? set_mode() : active_.output->show(wanted_on_panel());
    if (error == 0) return recovered();
    const CommitFailure failure = note_failure(error);
    if (failure == CommitFailure::Wrong) panel_check_due_ = true;
    if (failure != CommitFailure::Busy && failure != CommitFailure::Wrong) return;
    recover_at(now() + backoff_);
    backoff_ = std::min(2 * backoff_, kLongestBackoff);
  }
  void recovered() noexcept {
    recovery_attempts_ = 0;
    backoff_ = kShortestBackoff;
    ++counters_.recoveries;
    if (flip_.phase() == PendingFlip::Phase::Stuck) land(vblanks_.place_now());
  }
  [[nodiscard]] int set_mode() noexcept {
    ++counters_.modesets;
    const int error = active_.output->set_mode(wanted_on_panel());
    if (error != 0) return error;
    needs_modeset_ = false;
    vblanks_.rebase();
    return 0;
  }
  void recover_at(Nanoseconds when) noexcept {
    recover_at_ = when;
    flip_.stick(when);
  }
  void pause() noexcept {
    if (paused_) return;
    paused_ = true;
    ++counters_.times_paused;
    resume_backoff_ = kFirstResume;
    resume_at_ = now() + resume_backoff_;
    flip_.stick(resume_at_);
  }
  /// Tries to resume after a pause. The output's state may have changed meanwhile, so this takes a
  /// whole modeset, or switches the output off again.
  void try_resume() noexcept {
    if (session_->ensure_master(active_.output->device().fd()) == Mastership::Held) {
      const int error = off_ ? active_.output->blank() : set_mode();
      if (error == 0) {
        paused_ = false;
        resume_at_ = kNever;
        panel_check_due_ = true;
        return recovered();
      }
      if (classify(error) == CommitFailure::Gone) return mark_lost();
    }
    resume_backoff_ = std::min(2 * resume_backoff_, kLongestResume);
    resume_at_ = now() + resume_backoff_;
  }

  [[nodiscard]] Nanoseconds now() const noexcept { return clock_->now(); }
  /// Returns true if a modeset is due without a pending flip.
  [[nodiscard]] bool only_modeset_pending() const noexcept {
    return needs_modeset_ && !off_ && !flip_.under_way();
  }
  [[nodiscard]] uint32_t wanted_on_panel() const noexcept {
    return (flip_.buffer() != nullptr ? flip_.buffer() : active_.front)->framebuffer();
  }

  ActiveOutput& active_;
  std::shared_ptr<Session> session_;
  std::shared_ptr<Clock> clock_;
  KmsCounters& counters_;
  VblankClock vblanks_;
  PendingFlip flip_;
  uint64_t next_serial_;
  TileEvents tiles_;

  int recovery_attempts_ = 0;
  Nanoseconds backoff_;
  bool needs_modeset_ = false;
  Nanoseconds recover_at_{0};
  bool panel_check_due_ = false;
  bool lost_ = false;
  bool off_ = false;
  bool paused_ = false;
  Nanoseconds resume_at_ = kNever;
  Nanoseconds resume_backoff_;
};

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
    state.off = counters_.off ? 1 : 0;
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
    waiter_.emplace(device.fd(), monitor_->fd());
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
    ++counters_.suspends;
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

std::unique_ptr<KmsDisplay> open_kms_display(const KmsOptions& options) {
  check_options(options);
  return std::make_unique<AtomicKmsDisplay>(with_services(options));
}

}  // namespace lenticule::display
