// SPDX-License-Identifier: Apache-2.0
#include "display/kms/kms_display.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <atomic>
#include <cerrno>
#include <cstring>
#include <utility>

#include "display/kms/drm_events.h"
#include "display/kms/event_waiter.h"
#include "display/kms/mode_choice.h"
#include "display/kms/open_kms.h"
#include "display/kms/panel_watch.h"
#include "display/kms/vblank_counter.h"
#include "optics/error.h"

namespace lenticule::display {
namespace {

using std::chrono::milliseconds;

constexpr int kRefusalsBeforeRecovery = 5;
constexpr int kSameSequencesBeforeSoftware = 2;
constexpr Nanoseconds kShortestBackoff = milliseconds(50);
constexpr Nanoseconds kLongestBackoff = std::chrono::seconds(1);
constexpr Nanoseconds kFirstResume = milliseconds(100);
constexpr Nanoseconds kLongestResume = std::chrono::seconds(2);
constexpr Nanoseconds kTickPatience = milliseconds(200);
constexpr Nanoseconds kSleepNoticed = milliseconds(500);
constexpr Nanoseconds kProbeAgain = std::chrono::seconds(2);
constexpr Nanoseconds kNever = Nanoseconds::max();

enum class Failure { Busy, Denied, Gone, Wrong };

Failure classify(int negative_errno) noexcept {
  switch (-negative_errno) {
    case EBUSY:
      return Failure::Busy;
    case EACCES:
    case EPERM:
      return Failure::Denied;
    case ENODEV:
    case EIO:
    case ENXIO:
    case EBADF:
      return Failure::Gone;
    default:
      return Failure::Wrong;
  }
}

/// One writer, any readers.
class Count {
 public:
  void add() noexcept { value_.fetch_add(1, std::memory_order_relaxed); }
  [[nodiscard]] uint64_t get() const noexcept { return value_.load(std::memory_order_relaxed); }

 private:
  std::atomic<uint64_t> value_{0};
};

struct Counts {
  Count flips, busy, denied, refused, flip_timeouts, stray_events, truncated_reads, recoveries,
      modesets, hotplugs, links_bad, suspends, pauses, lost_ticks;
};

/// The flip that was accepted and not yet reported.
struct Flip {
  enum class Phase {
    None,
    Queued,  ///< refused as busy: committed again when due
    Armed,   ///< committed: its event is awaited until due
    Stuck,   ///< shown by a blocking commit when due
    Landed,  ///< on the glass since `vblank`, to be reported
  };
  Phase phase = Phase::None;
  KmsBuffer* buffer = nullptr;
  uint64_t id = 0;      ///< the caller's
  uint64_t serial = 0;  ///< ours, in the kernel's event
  Nanoseconds due{0};
  int refusals = 0;
  Vblank vblank{};
};

/// The vblank that was asked for.
struct Tick {
  enum class Phase { None, Awaited, Timed, Ready };
  Phase phase = Phase::None;
  uint64_t sequence = 0;
  uint64_t serial = 0;
  Nanoseconds due{0};
  Vblank vblank{};
};

KmsOptions with_services(KmsOptions options) {
  if (!options.clock) options.clock = make_monotonic_clock();
  if (!options.session) options.session = make_direct_session();
  if (!options.platform) options.platform = make_linux_platform();
  return options;
}

void check_options(const KmsOptions& options) {
  if (options.wish.panel.format != frames::PixelFormat::Rgb8)
    throw Error(ErrorKind::Usage, "kms: only 8-bit RGB frames can be shown");
  if (options.buffers < kMinScanoutBuffers || options.buffers > kMaxScanoutBuffers)
    throw Error(ErrorKind::Usage, fmt::format("kms: {} scan-out buffers", options.buffers),
                fmt::format("use {} to {}", kMinScanoutBuffers, kMaxScanoutBuffers));
}

class AtomicKmsDisplay final : public KmsDisplay, private DrmEventHandler {
 public:
  explicit AtomicKmsDisplay(KmsOptions options)
      : options_(std::move(options)), clock_(options_.clock) {
    open();
  }
  ~AtomicKmsDisplay() override { close(); }
  AtomicKmsDisplay(const AtomicKmsDisplay&) = delete;
  AtomicKmsDisplay& operator=(const AtomicKmsDisplay&) = delete;

  [[nodiscard]] const DisplayMode& mode() const override { return mode_; }
  [[nodiscard]] Nanoseconds now() const noexcept override { return clock_->now(); }

  [[nodiscard]] ScanoutBuffer* acquire() override {
    for (const auto& buffer : lit_.buffers)
      if (buffer->try_acquire()) return buffer.get();
    return nullptr;
  }
  void discard(ScanoutBuffer* buffer) override { owned(buffer)->set_state(ScanoutState::Free); }

  [[nodiscard]] SubmitStatus submit(ScanoutBuffer* buffer, uint64_t id) noexcept override;
  [[nodiscard]] bool request_vblank(uint64_t sequence) noexcept override;
  [[nodiscard]] DisplayEvent wait_event(Nanoseconds deadline, int wake_fd) noexcept override;

  void reconnect() override {
    close();
    open();
  }
  [[nodiscard]] KmsStatistics statistics() const noexcept override;
  [[nodiscard]] ExactnessReport exactness() const override {
    return lit_.output ? lit_.output->report() : ExactnessReport{};
  }
  [[nodiscard]] bool took_over() const noexcept override {
    return lit_.output && lit_.output->took_over();
  }
  [[nodiscard]] int card_fd() const noexcept override {
    return lit_.output ? lit_.output->device().fd() : -1;
  }
  [[nodiscard]] HandoverState handover() const noexcept override;

 private:
  void open();
  void close() noexcept;
  void start_counting();

  // What waits, and until when.
  [[nodiscard]] std::optional<DisplayEvent> take_ready(Nanoseconds now) noexcept;
  [[nodiscard]] Nanoseconds next_due() const noexcept;
  void handle(const ReadySet& ready) noexcept;
  void run_timers() noexcept;
  void notice_sleep() noexcept;

  // Flips.
  void try_flip() noexcept;
  void refused(int error) noexcept;
  void land(Vblank vblank) noexcept;
  DisplayEvent deliver_flip() noexcept;
  void on_drm_event(const DrmEvent& event) noexcept override;
  void on_flip_event(const DrmEvent& event) noexcept;
  void watch_sequences(uint64_t sequence) noexcept;

  // Trouble.
  void recover() noexcept;
  [[nodiscard]] int relight() noexcept;
  void back_off() noexcept;
  void relight_soon() noexcept;
  void pause() noexcept;
  void try_resume() noexcept;
  void lose() noexcept { lost_ = true; }
  void on_news(const PanelNews& news) noexcept;
  void on_connected(const ConnectorInfo& connector) noexcept;
  void set_panel(PanelState state) noexcept { panel_.store(state, std::memory_order_relaxed); }
  [[nodiscard]] PanelState panel() const noexcept { return panel_.load(std::memory_order_relaxed); }
  [[nodiscard]] bool is_expected_panel(const ConnectorInfo& connector) const noexcept;

  static KmsBuffer* owned(ScanoutBuffer* buffer) noexcept {
    auto* const mine = static_cast<KmsBuffer*>(buffer);
    LENTICULE_CHECK(mine != nullptr && mine->state() == ScanoutState::Acquired);
    return mine;
  }
  [[nodiscard]] KmsBuffer* wanted_on_glass() const noexcept {
    return flip_.buffer != nullptr ? flip_.buffer : lit_.front;
  }
  /// Less than the 250 ms after which a player takes a flip for landed.
  [[nodiscard]] Nanoseconds flip_patience() const noexcept {
    return std::max<Nanoseconds>(4 * vblanks_->period(), milliseconds(200));
  }

  KmsOptions options_;
  std::shared_ptr<Clock> clock_;
  LitOutput lit_;
  DisplayMode mode_;
  std::optional<VblankCounter> vblanks_;
  std::unique_ptr<PanelWatch> watch_;
  std::unique_ptr<EventWaiter> waiter_;

  // Presenter thread.
  Flip flip_;
  Tick tick_;
  uint64_t next_serial_ = 1;
  uint64_t last_flip_sequence_ = 0;
  uint64_t last_driver_sequence_ = 0;
  int same_sequences_ = 0;
  int recovery_attempts_ = 0;
  Nanoseconds backoff_ = kShortestBackoff;
  bool needs_modeset_ = false;
  bool lost_ = false;
  bool paused_ = false;
  Nanoseconds resume_at_ = kNever;
  Nanoseconds resume_backoff_ = kFirstResume;
  Nanoseconds probe_at_ = kNever;
  Nanoseconds asleep_{0};

  Counts counts_;
  std::atomic<PanelState> panel_{PanelState::Showing};
  std::atomic<bool> hardware_clock_{false};
};

// --- opening and closing --------------------------------------------------------------------

void AtomicKmsDisplay::open() {
  lit_ = light_output(options_);
  options_.inherited.reset();
  lit_.front->set_state(ScanoutState::OnGlass);
  const OutputTarget& target = lit_.output->target();
  mode_ = {.geometry = options_.wish.panel,
           .refresh = refresh_of(target.mode),
           .name = fmt::format("{} on {} {}", target.connector.name, lit_.output->device().path(),
                               to_string(target.mode)),
           .hardware_clock = false};
  start_counting();
  const int card = lit_.output->device().fd();
  watch_ = std::make_unique<PanelWatch>(
      card, target.connector, options_.platform->watch_hotplug(), clock_,
      clock_->real_time() ? PanelWatch::Running::OwnThread : PanelWatch::Running::InStep);
  waiter_ = std::make_unique<EventWaiter>(card, options_.session->fd(), watch_->fd());

  flip_ = {};
  tick_ = {};
  // Unlike the numbers of whoever had the card before us.
  next_serial_ = static_cast<uint64_t>(now().count()) | 1;
  lost_ = paused_ = needs_modeset_ = false;
  resume_at_ = probe_at_ = kNever;
  asleep_ = options_.platform->time_asleep();
  set_panel(PanelState::Showing);
}

void AtomicKmsDisplay::start_counting() {
  uint64_t sequence = 0;
  Nanoseconds time{0};
  const bool counts = lit_.output->read_sequence(sequence, time) == 0;
  const Nanoseconds at = time > Nanoseconds{0} && time <= now() ? time : now();
  vblanks_.emplace(counts ? VblankCounter::Source::Hardware : VblankCounter::Source::Software,
                   mode_.refresh, Vblank{counts ? sequence : 0, at});
  last_flip_sequence_ = vblanks_->last().sequence;
  same_sequences_ = 0;
  mode_.hardware_clock = counts;
  hardware_clock_.store(counts, std::memory_order_relaxed);
}

void AtomicKmsDisplay::close() noexcept {
  waiter_.reset();
  watch_.reset();
  if (!lit_.output) return;
  // A framebuffer is never removed while it is shown.
  if (options_.exit == ExitPolicy::Restore && !lost_) (void)lit_.output->restore();
  if (options_.exit == ExitPolicy::Black && !lost_) (void)lit_.output->blank();
  if (options_.exit == ExitPolicy::Hold && !lost_)
    for (const auto& buffer : lit_.buffers) buffer->abandon();
  lit_.front = nullptr;
  lit_.buffers.clear();
  const DrmDevice& device = lit_.output->device();
  if (options_.exit != ExitPolicy::Hold) device.session().drop_master(device.fd());
  lit_.output.reset();
}

// --- waiting --------------------------------------------------------------------------------

DisplayEvent AtomicKmsDisplay::wait_event(Nanoseconds deadline, int wake_fd) noexcept {
  while (true) {
    if (!lost_) run_timers();
    if (const auto event = take_ready(now())) return *event;
    if (lost_ || !waiter_) return {.kind = EventKind::Lost};
    const ReadySet ready = waiter_->wait(*clock_, std::min(deadline, next_due()), wake_fd);
    notice_sleep();
    handle(ready);
    if (const auto event = take_ready(now())) return *event;
    if (lost_) return {.kind = EventKind::Lost};
    if (ready.wake || now() >= deadline) return {.kind = EventKind::Timeout};
  }
}

std::optional<DisplayEvent> AtomicKmsDisplay::take_ready(Nanoseconds now) noexcept {
  if (flip_.phase == Flip::Phase::Landed && now >= flip_.due) return deliver_flip();
  if (tick_.phase == Tick::Phase::Ready) {
    tick_.phase = Tick::Phase::None;
    return DisplayEvent{
        .kind = EventKind::Vblank, .sequence = tick_.vblank.sequence, .time = tick_.vblank.time};
  }
  return std::nullopt;
}

Nanoseconds AtomicKmsDisplay::next_due() const noexcept {
  Nanoseconds next = std::min(watch_->next_step(), probe_at_);
  if (flip_.phase == Flip::Phase::Landed || (flip_.phase != Flip::Phase::None && !paused_))
    next = std::min(next, flip_.due);
  if (tick_.phase == Tick::Phase::Awaited || tick_.phase == Tick::Phase::Timed)
    next = std::min(next, tick_.due);
  if (paused_) next = std::min(next, resume_at_);
  return next;
}

void AtomicKmsDisplay::handle(const ReadySet& ready) noexcept {
  if (ready.card) {
    const EventRead result = read_drm_events(lit_.output->device().fd(), *this);
    if (result == EventRead::Truncated) counts_.truncated_reads.add();
    if (result == EventRead::Gone) lose();
  }
  if (ready.card_gone) lose();
  if (ready.session) {
    const bool ours = options_.session->dispatch();
    if (!ours && !paused_) pause();
    if (ours && paused_) resume_at_ = now();
  }
  if (ready.watch) watch_->step();
  if (const auto news = watch_->take_news()) on_news(*news);
}

void AtomicKmsDisplay::run_timers() noexcept {
  const Nanoseconds time = now();
  if (time >= watch_->next_step()) {
    watch_->step();
    if (const auto news = watch_->take_news()) on_news(*news);
  }
  if (time >= probe_at_) {
    probe_at_ = kNever;
    watch_->request_probe();
    if (const auto news = watch_->take_news()) on_news(*news);
  }
  if (paused_ && time >= resume_at_) try_resume();
  if (!paused_ && !lost_ && time >= flip_.due) {
    if (flip_.phase == Flip::Phase::Queued) try_flip();
    if (flip_.phase == Flip::Phase::Armed && time >= flip_.due) {
      counts_.flip_timeouts.add();
      flip_.phase = Flip::Phase::Stuck;
    }
    if (flip_.phase == Flip::Phase::Stuck && time >= flip_.due) recover();
  }
  if (time < tick_.due) return;
  if (tick_.phase == Tick::Phase::Awaited) {
    counts_.lost_ticks.add();
    tick_.vblank = vblanks_->last_until(time);
    tick_.phase = Tick::Phase::Ready;
  } else if (tick_.phase == Tick::Phase::Timed) {
    tick_.vblank = vblanks_->at(tick_.sequence);
    tick_.phase = Tick::Phase::Ready;
  }
}

/// Sleep takes pending flips with it, and leaves links in any state.
void AtomicKmsDisplay::notice_sleep() noexcept {
  const Nanoseconds asleep = options_.platform->time_asleep();
  const bool slept = asleep > asleep_ + kSleepNoticed;
  asleep_ = asleep;
  if (!slept) return;
  counts_.suspends.add();
  probe_at_ = now();
  relight_soon();
}

// --- flips ----------------------------------------------------------------------------------

SubmitStatus AtomicKmsDisplay::submit(ScanoutBuffer* buffer, uint64_t id) noexcept {
  KmsBuffer* const mine = owned(buffer);
  if (lost_) return SubmitStatus::Lost;
  if (paused_) return SubmitStatus::Paused;
  if (flip_.phase == Flip::Phase::Stuck) return SubmitStatus::Paused;
  if (flip_.phase != Flip::Phase::None) return SubmitStatus::Busy;

  mine->set_state(ScanoutState::Pending);
  flip_ = {.phase = Flip::Phase::Queued, .buffer = mine, .id = id};
  try_flip();
  if (!lost_ && !paused_) return SubmitStatus::Accepted;
  mine->set_state(ScanoutState::Acquired);
  flip_ = {};
  return lost_ ? SubmitStatus::Lost : SubmitStatus::Paused;
}

void AtomicKmsDisplay::try_flip() noexcept {
  flip_.serial = next_serial_++;
  if (const int error = lit_.output->flip(flip_.buffer->framebuffer(), flip_.serial); error != 0)
    return refused(error);
  flip_.phase = Flip::Phase::Armed;
  flip_.due = now() + flip_patience();
  flip_.refusals = 0;
}

void AtomicKmsDisplay::refused(int error) noexcept {
  switch (classify(error)) {
    case Failure::Busy:
      counts_.busy.add();
      flip_.due = now() + vblanks_->period();
      flip_.phase =
          ++flip_.refusals > kRefusalsBeforeRecovery ? Flip::Phase::Stuck : Flip::Phase::Queued;
      return;
    case Failure::Denied:
      counts_.denied.add();
      return pause();
    case Failure::Gone:
      return lose();
    case Failure::Wrong:
      counts_.refused.add();
      needs_modeset_ = true;
      flip_.phase = Flip::Phase::Stuck;
      flip_.due = now();
  }
}

/// By the driver's count the flip is reported at once, by ours when its tick comes. No two flips
/// share a vblank, whatever the driver says.
void AtomicKmsDisplay::land(Vblank vblank) noexcept {
  const bool software = vblanks_->source() == VblankCounter::Source::Software;
  const uint64_t earliest = last_flip_sequence_ + 1;
  if (vblank.sequence < earliest)
    vblank = software ? vblanks_->at(earliest) : Vblank{earliest, vblank.time};
  flip_.phase = Flip::Phase::Landed;
  flip_.vblank = vblank;
  flip_.due = software ? vblank.time : now();
}

DisplayEvent AtomicKmsDisplay::deliver_flip() noexcept {
  const Flip flip = std::exchange(flip_, Flip{});
  if (lit_.front != nullptr) lit_.front->set_state(ScanoutState::Free);
  lit_.front = flip.buffer;
  lit_.front->set_state(ScanoutState::OnGlass);
  last_flip_sequence_ = flip.vblank.sequence;
  counts_.flips.add();
  return {.kind = EventKind::Flip,
          .id = flip.id,
          .sequence = flip.vblank.sequence,
          .time = flip.vblank.time};
}

void AtomicKmsDisplay::on_drm_event(const DrmEvent& event) noexcept {
  if (event.kind == DrmEvent::Kind::Flip) return on_flip_event(event);
  if (tick_.phase != Tick::Phase::Awaited || event.id != tick_.serial)
    return counts_.stray_events.add();
  tick_.vblank = vblanks_->observe(event.sequence, event.time, now());
  tick_.phase = Tick::Phase::Ready;
}

void AtomicKmsDisplay::on_flip_event(const DrmEvent& event) noexcept {
  if (flip_.phase != Flip::Phase::Armed || event.id != flip_.serial)
    return counts_.stray_events.add();
  recovery_attempts_ = 0;
  watch_sequences(event.sequence);
  const Nanoseconds time = now();
  if (vblanks_->source() == VblankCounter::Source::Hardware)
    return land(
        vblanks_->observe_low_bits(static_cast<uint32_t>(event.sequence), event.time, time));
  const bool plausible = event.time > time - flip_patience() && event.time <= time;
  land(vblanks_->first_from(plausible ? event.time : time));
}

/// Two flips in the same vblank cannot be: such a driver does not count.
void AtomicKmsDisplay::watch_sequences(uint64_t sequence) noexcept {
  same_sequences_ = sequence == last_driver_sequence_ ? same_sequences_ + 1 : 0;
  last_driver_sequence_ = sequence;
  if (same_sequences_ < kSameSequencesBeforeSoftware || !mode_.hardware_clock) return;
  vblanks_->use_software(now());
  mode_.hardware_clock = false;
  hardware_clock_.store(false, std::memory_order_relaxed);
}

bool AtomicKmsDisplay::request_vblank(uint64_t sequence) noexcept {
  if (lost_) return false;
  const Nanoseconds time = now();
  const uint64_t target = std::max(sequence + 1, vblanks_->last_until(time).sequence);
  tick_ = {.phase = Tick::Phase::Timed,
           .sequence = target,
           .serial = next_serial_++,
           .due = vblanks_->at(target).time,
           .vblank = {}};
  if (vblanks_->source() == VblankCounter::Source::Software || paused_) return true;
  // While the output is off the driver does not count: then time does.
  if (lit_.output->queue_sequence(vblanks_->driver_sequence(target), tick_.serial) != 0)
    return true;
  tick_.phase = Tick::Phase::Awaited;
  tick_.due = std::max(tick_.due, time) + kTickPatience;
  return true;
}

// --- trouble --------------------------------------------------------------------------------

/// A blocking commit returns when the picture is on the glass; its success is what the lost event
/// would have said. Where it does not help, a modeset does, and where that does not, patience.
void AtomicKmsDisplay::recover() noexcept {
  const bool modeset = needs_modeset_ || ++recovery_attempts_ > 2;
  const int error = modeset ? relight() : lit_.output->show(wanted_on_glass()->framebuffer());
  if (error == 0) {
    recovery_attempts_ = 0;
    backoff_ = kShortestBackoff;
    counts_.recoveries.add();
    if (flip_.phase == Flip::Phase::Stuck) land(vblanks_->first_from(now()));
    return;
  }
  switch (classify(error)) {
    case Failure::Busy:
      counts_.busy.add();
      return back_off();
    case Failure::Denied:
      counts_.denied.add();
      return pause();
    case Failure::Gone:
      return lose();
    case Failure::Wrong:
      counts_.refused.add();
      needs_modeset_ = true;
      probe_at_ = std::min(probe_at_, now());
      return back_off();
  }
}

int AtomicKmsDisplay::relight() noexcept {
  counts_.modesets.add();
  const int error = lit_.output->relight(wanted_on_glass()->framebuffer());
  if (error != 0) return error;
  needs_modeset_ = false;
  vblanks_->rebase(now());
  return 0;
}

void AtomicKmsDisplay::back_off() noexcept {
  flip_.due = now() + backoff_;
  backoff_ = std::min(2 * backoff_, kLongestBackoff);
}

/// The flip under way, if there is one, is shown by the modeset.
void AtomicKmsDisplay::relight_soon() noexcept {
  needs_modeset_ = true;
  if (paused_) return;
  if (flip_.phase == Flip::Phase::Queued || flip_.phase == Flip::Phase::Armed)
    flip_.phase = Flip::Phase::Stuck;
  if (flip_.phase == Flip::Phase::Stuck) {
    flip_.due = now();
    return;
  }
  recover();
}

void AtomicKmsDisplay::pause() noexcept {
  if (paused_) return;
  paused_ = true;
  counts_.pauses.add();
  resume_backoff_ = kFirstResume;
  resume_at_ = now() + resume_backoff_;
  if (flip_.phase == Flip::Phase::Queued || flip_.phase == Flip::Phase::Armed)
    flip_.phase = Flip::Phase::Stuck;
}

/// Everything may have changed meanwhile: a whole modeset.
void AtomicKmsDisplay::try_resume() noexcept {
  const int card = lit_.output->device().fd();
  if (options_.session->ensure_master(card) == Mastership::Held) {
    const int error = relight();
    if (error == 0) {
      paused_ = false;
      resume_at_ = kNever;
      probe_at_ = now();
      counts_.recoveries.add();
      if (flip_.phase == Flip::Phase::Stuck) land(vblanks_->first_from(now()));
      return;
    }
    if (classify(error) == Failure::Gone) return lose();
  }
  resume_backoff_ = std::min(2 * resume_backoff_, kLongestResume);
  resume_at_ = now() + resume_backoff_;
}

bool AtomicKmsDisplay::is_expected_panel(const ConnectorInfo& connector) const noexcept {
  return options_.wish.policy == IdentityPolicy::Ignore || options_.wish.identity.empty() ||
         (connector.edid.identity && matches(options_.wish.identity, *connector.edid.identity));
}

void AtomicKmsDisplay::on_news(const PanelNews& news) noexcept {
  counts_.hotplugs.add();
  // The CRTC goes on: a panel that is only switched off and on then needs no modeset.
  if (!news.connector || !news.connector->connected) return set_panel(PanelState::Disconnected);
  try {
    on_connected(*news.connector);
  } catch (...) {
    probe_at_ = now() + kProbeAgain;  // no memory to judge it: look again
  }
}

void AtomicKmsDisplay::on_connected(const ConnectorInfo& connector) noexcept {
  if (!is_expected_panel(connector)) {
    if (connector.edid.problem != EdidProblem::None) {
      set_panel(PanelState::Unreadable);
      probe_at_ = now() + kProbeAgain;
      return;
    }
    // Frames woven for another panel are wrong for every eye: better none.
    set_panel(PanelState::WrongPanel);
    (void)lit_.output->blank();
    return lose();
  }
  const drmModeModeInfo& ours = lit_.output->target().mode;
  const bool listed = std::any_of(connector.modes.begin(), connector.modes.end(),
                                  [&](const auto& mode) { return same_timings(mode, ours); });
  if (!listed) {
    set_panel(PanelState::ModeMissing);
    probe_at_ = now() + kProbeAgain;
    return;
  }
  const bool was_away = panel() != PanelState::Showing;
  if (connector.link_bad) counts_.links_bad.add();
  set_panel(PanelState::Showing);
  lit_.output->renew_connector(connector);
  if (was_away || connector.link_bad) relight_soon();
}

// --- news for others ------------------------------------------------------------------------

KmsStatistics AtomicKmsDisplay::statistics() const noexcept {
  return {.flips = counts_.flips.get(),
          .busy = counts_.busy.get(),
          .denied = counts_.denied.get(),
          .refused = counts_.refused.get(),
          .flip_timeouts = counts_.flip_timeouts.get(),
          .stray_events = counts_.stray_events.get(),
          .truncated_reads = counts_.truncated_reads.get(),
          .recoveries = counts_.recoveries.get(),
          .modesets = counts_.modesets.get(),
          .hotplugs = counts_.hotplugs.get(),
          .links_bad = counts_.links_bad.get(),
          .suspends = counts_.suspends.get(),
          .pauses = counts_.pauses.get(),
          .lost_ticks = counts_.lost_ticks.get(),
          .panel = panel(),
          .hardware_clock = hardware_clock_.load(std::memory_order_relaxed)};
}

template <size_t N>
void copy_text(const std::string& text, std::array<char, N>& to) noexcept {
  std::memcpy(to.data(), text.data(), std::min(text.size(), N));
}

HandoverState AtomicKmsDisplay::handover() const noexcept {
  HandoverState state;
  if (!lit_.output) return state;
  const OutputTarget& target = lit_.output->target();
  state.connector = target.connector.id;
  state.crtc = target.pipe.crtc;
  state.plane = target.pipe.plane;
  state.width = mode_.geometry.width;
  state.height = mode_.geometry.height;
  state.buffer_count = static_cast<uint32_t>(lit_.buffers.size());
  for (size_t i = 0; i < lit_.buffers.size(); ++i) {
    const ScanoutNames names = lit_.buffers[i]->names();
    state.buffers.at(i) = {names.handle, names.framebuffer, names.pitch, 0, names.size};
  }
  if (target.connector.edid.identity)
    copy_text(target.connector.edid.identity->sha256, state.edid_sha256);
  copy_text(lit_.output->device().path(), state.card);
  state.card.back() = '\0';
  return state;
}

}  // namespace

const char* panel_state_name(PanelState state) {
  switch (state) {
    case PanelState::Showing:
      return "showing";
    case PanelState::Disconnected:
      return "disconnected";
    case PanelState::Unreadable:
      return "unreadable";
    case PanelState::ModeMissing:
      return "mode missing";
    case PanelState::WrongPanel:
      return "wrong panel";
  }
  return "?";
}

std::unique_ptr<KmsDisplay> open_kms_display(const KmsOptions& options) {
  check_options(options);
  return std::make_unique<AtomicKmsDisplay>(with_services(options));
}

}  // namespace lenticule::display
