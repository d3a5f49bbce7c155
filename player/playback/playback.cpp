// SPDX-License-Identifier: Apache-2.0
#include "player/playback/playback.h"

#include <fmt/format.h>
#include <poll.h>
#include <pthread.h>
#include <sched.h>

#include <algorithm>
#include <thread>

#include "base/error.h"

namespace lenticule::player {
namespace {

using std::chrono::milliseconds;
using SteadyClock = std::chrono::steady_clock;

constexpr milliseconds kReportInterval{1000};
constexpr milliseconds kPowerPoll{5};
constexpr int kPresenterPriority =
    10;  // below the kernel's interrupt threads, above everything else

/// Returns true if the real-time priority was granted.
bool take_real_time_priority() noexcept {
  sched_param parameters{};
  parameters.sched_priority = kPresenterPriority;
  return pthread_setschedparam(pthread_self(), SCHED_FIFO | SCHED_RESET_ON_FORK, &parameters) == 0;
}

/// Threads owns the threads of one playback and ends them in its destructor.
class Threads {
 public:
  Threads(display::Display& display, frames::FrameSource& source, LiveStatistics& statistics,
          const PlaybackOptions& options)
      : statistics_(statistics),
        own_copier_thread_(options.filling == Filling::OwnThread),
        real_time_(options.real_time_priority),
        frame_copier_(source, display, statistics.frame_copier, options),
        presenter_(display, frame_copier_, statistics.presenter, options),
        control_(options.control) {
    if (control_ != nullptr) control_->attach(presenter_, frame_copier_, statistics_.presenter);
  }
  ~Threads() {
    end();
    if (control_ != nullptr) control_->detach();
  }
  Threads(const Threads&) = delete;
  Threads& operator=(const Threads&) = delete;

  /// Returns a descriptor that is readable when the presenter has finished.
  [[nodiscard]] int over_fd() const noexcept { return over_.fd(); }
  void request_stop() noexcept { presenter_.request_stop(); }

  void start() {
    if (own_copier_thread_) copier_thread_ = std::thread([this] { frame_copier_.run(); });
    presenter_thread_ = std::thread([this] {
      if (real_time_ && take_real_time_priority()) statistics_.presenter.real_time.set(1);
      outcome_ = presenter_.run();
      over_.signal();
    });
  }

  /// Forgets the lost display's buffers. Call it after end(), before the display is opened again.
  void forget_buffers() noexcept { frame_copier_.forget_buffers(); }
  /// Starts the threads again after forget_buffers(), once the display is back.
  void start_again() {
    over_.drain();
    presenter_.resume(frame_copier_.begin_again());
    start();
  }

  /// Joins the threads; outcome() and failure() are final afterwards.
  void end() noexcept {
    presenter_.request_stop();
    if (presenter_thread_.joinable()) presenter_thread_.join();
    frame_copier_.request_stop();
    if (copier_thread_.joinable()) copier_thread_.join();
  }
  void finish_statistics() noexcept { presenter_.finish_statistics(); }
  [[nodiscard]] PlayOutcome outcome() const noexcept { return outcome_; }
  [[nodiscard]] auto time_left() const noexcept { return presenter_.time_left(); }
  [[nodiscard]] std::string failure() const {
    return frame_copier_.state() == FrameCopier::State::Failed ? frame_copier_.failure()
                                                               : std::string();
  }

 private:
  LiveStatistics& statistics_;
  const bool own_copier_thread_;
  const bool real_time_;
  FrameCopier frame_copier_;
  Presenter presenter_;
  PlaybackControl* const control_;
  WakeFd over_;
  PlayOutcome outcome_ = PlayOutcome::Stopped;
  std::thread copier_thread_;
  std::thread presenter_thread_;
};

double measured_refresh_hz(const PresenterStatistics& statistics) {
  const uint64_t vblanks = statistics.last_sequence.get() - statistics.first_sequence.get();
  const uint64_t elapsed = statistics.last_vblank_ns.get() - statistics.first_vblank_ns.get();
  const bool known = statistics.first_vblank_ns.get() > 0 && vblanks > 0 && elapsed > 0;
  return known ? static_cast<double>(vblanks) * 1e9 / static_cast<double>(elapsed) : 0.0;
}

double first_frame_ms(const PresenterStatistics& statistics, SteadyClock::time_point started) {
  const uint64_t flip = statistics.first_flip_ns.get();
  if (flip == 0) return 0.0;
  const auto since = std::chrono::nanoseconds(flip) - started.time_since_epoch();
  return std::chrono::duration<double, std::milli>(since).count();
}

StageDelays stage_delays(const LiveStatistics& live) {
  const auto seconds = [](uint64_t ns) { return static_cast<double>(ns) * 1e-9; };
  const auto since = [&](uint64_t turn_ns) {
    const auto now = std::chrono::nanoseconds(SteadyClock::now().time_since_epoch());
    return turn_ns == 0 ? 0.0 : seconds(static_cast<uint64_t>(now.count()) - turn_ns);
  };
  return {.source = seconds(live.presenter.starved_ns.get()),
          .frame_copier = since(live.frame_copier.turn_ns.get()),
          .presenter = since(live.presenter.turn_ns.get()),
          .display = seconds(live.presenter.silent_ns.get()),
          .source_waits_for_others = live.frame_copier.waits_for_others.get() != 0};
}

void add_counters(const LiveStatistics& live, PlayReport& report) {
  const PresenterStatistics& presenter = live.presenter;
  report.real_time = presenter.real_time.get() != 0;
  report.off = presenter.off.get() != 0;
  report.item = presenter.displayed.read().item;
  report.pace = presenter.pace.read();
  report.delays = stage_delays(live);
  if (presenter.content_numerator.get() > 0)
    report.content_rate = {
        .numerator = static_cast<int64_t>(presenter.content_numerator.get()),
        .denominator = static_cast<int64_t>(presenter.content_denominator.get())};
  for (size_t k = 0; k < std::size(kPresenterCounters<Counter>); ++k)
    report.*kPresenterCounters<uint64_t>[k].second =
        (presenter.*kPresenterCounters<Counter>[k].second).get();
  report.refresh_measured_hz = measured_refresh_hz(presenter);
  report.submit_to_flip = presenter.submit_to_flip.summary();
  report.wake = presenter.wake.summary();

  const FrameCopierStatistics& frame_copier = live.frame_copier;
  for (size_t k = 0; k < std::size(kFrameCopierCounters<Counter>); ++k)
    report.*kFrameCopierCounters<uint64_t>[k].second =
        (frame_copier.*kFrameCopierCounters<Counter>[k].second).get();
  report.ready_min = frame_copier.ready_min.get();
  const uint64_t samples = frame_copier.ready_samples.get();
  if (samples > 0)
    report.ready_avg =
        static_cast<double>(frame_copier.ready_sum.get()) / static_cast<double>(samples);
  report.copy = frame_copier.copy.summary();
}

class Reporter {
 public:
  Reporter(const display::Display& display, const PlaybackOptions& options,
           const LiveStatistics& live)
      : live_(live), started_(options.started) {
    still_.source = options.source_name;
    still_.late = options.late;
    look_at(display);
  }

  /// Reads the display's mode; no other thread may use the display meanwhile.
  void look_at(const display::Display& display) {
    const display::DisplayMode& mode = display.mode();
    still_.display = mode.name;
    still_.geometry = mode.geometry;
    still_.refresh = mode.refresh;
    still_.hardware_clock = mode.hardware_clock;
  }

  [[nodiscard]] PlayReport now(const char* outcome) const {
    PlayReport report = still_;
    report.outcome = outcome;
    add_counters(live_, report);
    report.first_frame_ms = first_frame_ms(live_.presenter, started_);
    report.memory = read_resident_memory();
    return report;
  }

 private:
  const LiveStatistics& live_;
  SteadyClock::time_point started_;
  PlayReport still_;  ///< constant fields
};

/// Waits for the presenter's end; forwards the stop request and sends reports.
void watch(Threads& threads, const Reporter& reporter, const PlaybackOptions& options) {
  const int turns_fd = options.turns != nullptr ? options.turns->fd() : -1;
  pollfd entries[3] = {{.fd = threads.over_fd(), .events = POLLIN, .revents = 0},
                       {.fd = options.stop_fd, .events = POLLIN, .revents = 0},
                       {.fd = turns_fd, .events = POLLIN, .revents = 0}};
  auto next_report = SteadyClock::now() + kReportInterval;
  while (true) {
    const auto left = std::chrono::ceil<milliseconds>(next_report - SteadyClock::now());
    (void)poll(entries, 3, static_cast<int>(std::max(milliseconds(0), left).count()));
    if (entries[0].revents != 0) return;
    if (entries[1].revents != 0) {
      threads.request_stop();
      entries[1].fd = -1;  // report the stop only once
    }
    if (entries[2].revents != 0 && options.on_turn) options.on_turn();
    if (SteadyClock::now() < next_report) continue;
    next_report = SteadyClock::now() + kReportInterval;
    if (options.on_report) options.on_report(reporter.now("playing"));
  }
}

ReconnectResult reconnect(const Threads& threads, const Reporter& reporter,
                          frames::FrameSource& source, const PlaybackOptions& options) {
  const PlayReport report = reporter.now(outcome_name(PlayOutcome::DisplayLost));
  return options.reconnect({.report = report,
                            .time_left = threads.time_left(),
                            .serve_source = [&source] { source.service(); }});
}

/// Plays to the end, reconnecting the display whenever it is lost and can be reopened.
PlayOutcome play_to_the_end(Threads& threads, Reporter& reporter, display::Display& display,
                            frames::FrameSource& source, const PlaybackOptions& options) {
  threads.start();
  while (true) {
    watch(threads, reporter, options);
    threads.end();
    if (threads.outcome() != PlayOutcome::DisplayLost) return threads.outcome();
    if (!options.reconnect) return PlayOutcome::DisplayLost;
    threads.forget_buffers();
    const ReconnectResult result = reconnect(threads, reporter, source, options);
    if (result == ReconnectResult::TimeOver) return PlayOutcome::Finished;
    if (result == ReconnectResult::Stopped) return PlayOutcome::Stopped;
    if (result == ReconnectResult::GivenUp) return PlayOutcome::DisplayLost;
    reporter.look_at(display);
    threads.start_again();
  }
}

void check_sizes(const display::Display& display, const frames::FrameSource& source,
                 const std::string& name) {
  const frames::FrameGeometry panel = display.mode().geometry;
  const frames::FrameGeometry frame = source.geometry();
  if (frame == panel) return;
  throw Error(ErrorKind::Input,
              fmt::format("{}: frames of {}x{} pixels, but the display has {}x{}", name,
                          frame.width, frame.height, panel.width, panel.height),
              "woven frames fit one panel, pixel for pixel: render or weave them for this rig");
}

}  // namespace

void PlaybackControl::attach(Presenter& presenter, FrameCopier& frame_copier,
                             const PresenterStatistics& statistics) {
  const std::scoped_lock lock(copy_mutex_, mutex_);
  presenter_ = &presenter;
  frame_copier_ = &frame_copier;
  statistics_ = &statistics;
  presenter.set_paused(paused_);
  presenter.set_off(off_);
  presenter.set_speed(speed_permille_);
}

void PlaybackControl::detach() {
  const std::scoped_lock lock(copy_mutex_, mutex_);
  presenter_ = nullptr;
  frame_copier_ = nullptr;
  statistics_ = nullptr;
}

void PlaybackControl::pause(bool paused) {
  const std::lock_guard lock(mutex_);
  paused_ = paused;
  if (presenter_ != nullptr) presenter_->set_paused(paused);
}

bool PlaybackControl::paused() const {
  const std::lock_guard lock(mutex_);
  return paused_;
}

bool PlaybackControl::switch_output(bool on, milliseconds timeout) {
  {
    const std::lock_guard lock(mutex_);
    off_ = !on;
    if (presenter_ == nullptr) return false;
    presenter_->set_off(off_);
  }
  // Polled, because the presenter takes no lock to report anything.
  const auto deadline = SteadyClock::now() + timeout;
  while (is_off() == on && SteadyClock::now() < deadline) std::this_thread::sleep_for(kPowerPoll);
  return is_off() != on;
}

bool PlaybackControl::is_off() const {
  const std::lock_guard lock(mutex_);
  return statistics_ != nullptr && statistics_->off.get() != 0;
}

void PlaybackControl::set_speed(uint32_t permille) {
  const std::lock_guard lock(mutex_);
  speed_permille_ = permille;
  if (presenter_ != nullptr) presenter_->set_speed(permille);
}

uint32_t PlaybackControl::speed_permille() const {
  const std::lock_guard lock(mutex_);
  return speed_permille_;
}

bool PlaybackControl::time_next_cut() {
  const std::lock_guard lock(mutex_);
  return presenter_ == nullptr || presenter_->time_next_cut();
}

void PlaybackControl::forget_next_cut() {
  const std::lock_guard lock(mutex_);
  if (presenter_ != nullptr) presenter_->forget_next_cut();
}

DisplayedPlace PlaybackControl::displayed() const {
  const std::lock_guard lock(mutex_);
  return statistics_ != nullptr ? statistics_->displayed.read() : DisplayedPlace{};
}

LeftItem PlaybackControl::left_item(uint64_t item) const {
  const std::lock_guard lock(mutex_);
  if (statistics_ == nullptr) return {};
  const DisplayedPlace displayed = statistics_->displayed.read();
  if (displayed.frames > 0 && displayed.item == item)
    return {.still_displayed = true, .last = displayed};
  const DisplayedPlace left = statistics_->left.read();
  if (left.frames > 0 && left.item == item) return {.still_displayed = false, .last = left};
  return {};
}

bool PlaybackControl::copy_shown(frames::WovenFrame& into, size_t part) {
  const std::lock_guard lock(copy_mutex_);
  if (frame_copier_ == nullptr || displayed().frames == 0) return false;
  return frame_copier_->copy_shown(into, part, milliseconds(1000));
}

const char* outcome_name(PlayOutcome outcome) {
  switch (outcome) {
    case PlayOutcome::Finished:
      return "finished";
    case PlayOutcome::Stopped:
      return "interrupted";
    case PlayOutcome::SourceFailed:
      return "source failed";
    case PlayOutcome::SourceStalled:
      return "source stalled";
    case PlayOutcome::DisplayLost:
      return "display lost";
  }
  return "unknown";
}

PlayResult play(display::Display& display, frames::FrameSource& source,
                const PlaybackOptions& options) {
  check_sizes(display, source, options.source_name);
  LiveStatistics statistics;
  Reporter reporter(display, options, statistics);
  Threads threads(display, source, statistics, options);
  const PlayOutcome outcome = play_to_the_end(threads, reporter, display, source, options);
  threads.finish_statistics();
  return {.outcome = outcome,
          .failure = threads.failure(),
          .report = reporter.now(outcome_name(outcome))};
}

}  // namespace lenticule::player
