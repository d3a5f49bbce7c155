// SPDX-License-Identifier: Apache-2.0
#include "player/session/play_run.h"

#include <fmt/format.h>
#include <poll.h>
#include <sys/epoll.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <chrono>
#include <memory>
#include <nlohmann/json.hpp>
#include <optional>
#include <set>
#include <thread>
#include <utility>
#include <vector>

#include "base/error.h"
#include "base/installation.h"
#include "base/json_output.h"
#include "base/print.h"
#include "base/retried_writes.h"
#include "base/subprocess.h"
#include "base/unique_fd.h"
#include "display/kms/scanout/kms_display.h"
#include "display/open/open_display.h"
#include "display/scanout_recorder.h"
#include "frames/ring/shared_picture.h"
#include "optics/trim.h"
#include "player/playback/playback.h"
#include "player/process/interrupt.h"
#include "player/process/key_input.h"
#include "player/process/progress.h"
#include "player/proof/proof_of_play.h"
#include "player/session/panel_card.h"
#include "player/session/panel_json.h"
#include "player/session/panel_wait.h"
#include "player/session/statistics_file.h"
#include "player/session/steered_play.h"
#include "player/sources/open_source.h"
#include "player/sources/still_source.h"

namespace lenticule::player {
namespace {

using nlohmann::ordered_json;

constexpr const char* kProgram = "lenticule-window";
constexpr int kOpenLimitMs = 30'000;  ///< a busy machine may take seconds to start a program
constexpr std::chrono::seconds kEndLimit{5};
constexpr int kPicturesThere = 3;
constexpr int kReadyThere = 4;

Error program_error(const std::string& what) {
  return {ErrorKind::Device, fmt::format("display 'window': {}", what),
          fmt::format("{} reports the cause above; it needs a desktop session", kProgram)};
}

UniqueFd readable_with_any_of(const std::vector<int>& descriptors) {
  UniqueFd all(::epoll_create1(EPOLL_CLOEXEC));
  for (const int fd : descriptors) {
    epoll_event event{.events = EPOLLIN, .data = {.fd = fd}};
    if (fd >= 0 && ::epoll_ctl(all.get(), EPOLL_CTL_ADD, fd, &event) != 0)
      throw Error(ErrorKind::Failed, "display 'window': no descriptor is left for its end");
  }
  return all;
}

/// PreviewWindow shows on a desktop what two eyes see of a virtual display. The window belongs to
/// lenticule-window, a program of its own, because a player on a kiosk needs no desktop. Thread
/// safety: as ScanoutRecorder.
class PreviewWindow final : public display::ScanoutRecorder {
 public:
  /// Starts the window's program and waits until its window is open. `sent` is the size of the
  /// pictures that are sent to the rig's panel. Throws Error(Failed) if the program is not
  /// installed, Error(Device) if there is no desktop.
  PreviewWindow(const std::string& rig_file, frames::FrameGeometry sent, int interrupt_fd)
      : pictures_(sent.width, sent.height) {
    Pipe pipe = make_pipe();
    program_ = Subprocess(
        {require_program("display 'window'", kProgram, kProgram).string(), "--rig", rig_file,
         "--pictures", std::to_string(kPicturesThere), "--ready", std::to_string(kReadyThere)},
        {{.here = pictures_.fd(), .there = kPicturesThere},
         {.here = pipe.writing.get(), .there = kReadyThere},
         {.here = STDERR_FILENO, .there = STDERR_FILENO}});
    pipe.writing.reset();
    ready_ = std::move(pipe.reading);
    stop_ = readable_with_any_of({ready_.get(), interrupt_fd});
    pollfd waiting{.fd = stop_.get(), .events = POLLIN, .revents = 0};
    char byte = 0;
    const bool answered = ::poll(&waiting, 1, kOpenLimitMs) == 1;
    pollfd opened{.fd = ready_.get(), .events = POLLIN, .revents = 0};
    const bool interrupted = answered && ::poll(&opened, 1, 0) == 0;
    if (!interrupted && (!answered || ::read(ready_.get(), &byte, 1) != 1))
      throw program_error("the window was not opened");
  }

  void record(const display::ShownFrame& shown,
              const display::ScanoutView& scanout) noexcept override {
    (void)shown;
    pictures_.publish(scanout.pixels, scanout.stride);
  }
  void finish() override {}

  /// Returns a descriptor that is readable once the window is closed or `interrupt_fd` is readable.
  [[nodiscard]] int stop_fd() const { return stop_.get(); }
  /// Throws Error(Failed) if the window's program has ended with an error.
  void check() {
    pollfd pipe{.fd = ready_.get(), .events = POLLIN, .revents = 0};
    if (!program_ || ::poll(&pipe, 1, 0) == 0) return;  // it still runs: the player was interrupted
    const auto end = program_.wait_until(std::chrono::steady_clock::now() + kEndLimit);
    if (end && end->exit_code != 0) throw program_error("the window's program failed");
  }

 private:
  frames::SharedPictureWriter pictures_;
  UniqueFd ready_;
  UniqueFd stop_;
  Subprocess program_;
};

/// TrimKeys reads keys from the terminal while a source plays, and applies them to the trim.
class TrimKeys {
 public:
  /// Prints the trim's advice after the first change. Throws Error(Usage) if standard input is not
  /// a terminal.
  explicit TrimKeys(std::shared_ptr<LiveRig> trim) : trim_(std::move(trim)) {
    if (isatty(STDIN_FILENO) != 1)
      throw Error(ErrorKind::Usage, "--trim: standard input is not a terminal",
                  "use lenticule rig trim RIG --offset-by 0.01");
    keys_ = open_key_input({});
    thread_ = std::jthread([this](const std::stop_token& stop) { listen(stop); });
  }
  /// Restores the terminal.
  ~TrimKeys() {
    thread_.request_stop();
    wake_.signal();
  }

 private:
  void listen(const std::stop_token& stop) noexcept {
    while (!stop.stop_requested() && !keys_->at_end()) {
      std::array<pollfd, 2> ready{{{.fd = keys_->fd(), .events = POLLIN, .revents = 0},
                                   {.fd = wake_.fd(), .events = POLLIN, .revents = 0}}};
      (void)poll(ready.data(), ready.size(), static_cast<int>(kEscapePause.count()));
      for (const KeyPress& press : keys_->take()) report(trim_->press(press));
    }
  }

  /// Prints a sentence on a line of its own, over a progress line.
  void report(const std::string& sentence) {
    if (sentence.empty()) return;
    say("\r\x1b[K{}\n", sentence);
    const std::string advice = trim_->advice();
    if (!advice.empty() && !std::exchange(advised_, true)) say("{}\n", advice);
  }

  std::shared_ptr<LiveRig> trim_;
  bool advised_ = false;
  std::unique_ptr<KeyInput> keys_;
  WakeFd wake_;
  std::jthread thread_;  // last member: the thread uses everything above
};

/// PlayOutputs looks after the files that a run of `lenticule play` writes: statistics, recording,
/// trim. A file that cannot be written is reported and tried again; playing goes on.
/// Thread safety: one thread.
class PlayOutputs {
 public:
  /// Opens the file of --stats. Lifetime: must not outlive `flags` and `plan`.
  PlayOutputs(const PlayFlags& flags, PlayPlan& plan) : flags_(flags), plan_(plan) {
    if (!flags.stats.empty()) statistics_.emplace(flags.stats);
  }

  void write_statistics(const ordered_json& statistics) {
    if (statistics_) statistics_->write(json_text(statistics, 2) + "\n");
  }
  /// Adds the key `write_problems`.
  void describe_problems(ordered_json& statistics) const {
    statistics["write_problems"] = ordered_json::array();
    for (const File& file : files())
      if (file.state.failures > 0)
        statistics["write_problems"].push_back({{"object", file.name},
                                                {"cause", file.state.reason},
                                                {"failures", file.state.failures}});
  }

  /// Reports each file once when writing begins to fail, and once when it works again. Returns all
  /// present reasons in one line; empty if all files can be written.
  [[nodiscard]] std::string report_problems() {
    std::string all;
    for (const File& file : files()) {
      const std::string& reason = file.state.reason;
      if (!reason.empty()) {
        const bool names_it = reason.find(": ") != std::string::npos;
        const std::string what = names_it ? reason : fmt::format("{}: {}", file.name, reason);
        all += all.empty() ? what : ", " + what;
        if (cannot_write_.insert(file.name).second)
          say("{}; playback continues, and the player tries again\n", what);
      } else if (cannot_write_.erase(file.name) > 0) {
        say("{}: written again after {} failures\n", file.name, file.state.failures);
      }
    }
    return all;
  }

  /// Writes without waiting for the pause after a failure.
  void try_at_once() {
    if (statistics_) statistics_->try_at_once();
    if (plan_.display.recorder) plan_.display.recorder->writes().try_at_once();
    if (plan_.trim) plan_.trim->writes().try_at_once();
  }

  /// Completes the recording, after its display was closed. Returns its statistics; null
  /// without a recording.
  [[nodiscard]] nlohmann::ordered_json finish_recording() {
    if (!plan_.display.recorder) return nullptr;
    display::ScanoutRecorder& recorder = *plan_.display.recorder;
    try {
      recorder.finish();
    } catch (const Error& error) {
      incomplete_ = error;
    }
    const uint64_t skipped = recorder.skipped();
    if (skipped > 0)
      say("{}: {} displayed frames came too fast and are not recorded\n"
          "  record checksums, play fewer frames per second, or use --clock simulated\n",
          flags_.record, skipped);
    return {{"place", flags_.record}, {"skipped", skipped}, {"lost", recorder.lost()}};
  }

  /// Waits until the last statistics are written, at most ten seconds.
  void finish_statistics() {
    constexpr auto kLongestFinish = std::chrono::seconds(10);
    if (!statistics_) return;
    const std::string why = statistics_->finish(kLongestFinish);
    if (!why.empty() && !incomplete_) incomplete_.emplace(ErrorKind::Failed, why);
  }

  /// Returns the first output that is incomplete at the end.
  [[nodiscard]] const std::optional<Error>& incomplete() const { return incomplete_; }

 private:
  struct File {
    std::string name;
    WriteState state;
  };
  [[nodiscard]] std::vector<File> files() const {
    std::vector<File> files;
    if (statistics_) files.push_back({flags_.stats, statistics_->state()});
    if (!flags_.record.empty() && plan_.display.recorder)
      files.push_back({flags_.record, plan_.display.recorder->writes().state()});
    if (plan_.trim)
      files.push_back(
          {optics::trim_file_of(plan_.rig_file).string(), plan_.trim->writes().state()});
    return files;
  }

  const PlayFlags& flags_;
  PlayPlan& plan_;
  std::optional<StatisticsFile> statistics_;
  std::set<std::string> cannot_write_;  ///< files already reported as not writable
  std::optional<Error> incomplete_;
};

using display::Nanoseconds;
using std::chrono::seconds;

/// Time that a test card is shown before its source is tried again.
constexpr Nanoseconds kTryAgain = std::chrono::seconds(5);
/// The same for a source that seems to crash the player.
constexpr Nanoseconds kTryDangerousSource = std::chrono::seconds(60);

void update_progress(Progress& progress, const PlayReport& report) {
  progress.update(report.pace.shown,
                  fmt::format("{} underruns, {} missed vblanks, {} dropped", report.pace.underruns,
                              report.pace.missed, report.pace.dropped));
}

Error crash_loop(const SafeStart& safe) {
  const std::string last = safe.last_reason.empty() ? "it crashed or was killed" : safe.last_reason;
  return {ErrorKind::Failed,
          fmt::format("the player ended {} times within two minutes; the last "
                      "time: {}",
                      safe.failures, last),
          "see the journal"};
}

/// Thread safety: one thread.
class PlayRun {
 public:
  PlayRun(const PlayFlags& flags, PlayPlan plan, const ServiceManager& manager, SafeStart safe)
      : flags_(flags),
        plan_(std::move(plan)),
        manager_(manager),
        safe_(std::move(safe)),
        outputs_(flags_, plan_),
        card_time_(safe_.card_first ? kTryDangerousSource : kTryAgain) {
    if (!safe_.on) return;
    plan_.display.kms.fresh = true;
    plan_.playback.real_time_priority = false;
  }

  /// Detaches the control socket's commands from the source before the source is destroyed.
  ~PlayRun() {
    if (steered_) steered_->detach_source();
  }

  /// Runs once. Throws Error for a failure that ends the run.
  ExitCode run() {
    steered_.emplace(flags_, plan_);
    if (safe_.card_first)
      source_error_ = crash_loop(safe_);
    else
      open_the_source();
    if (!flags_.record.empty()) plan_.display.recorder = display::open_recorder(flags_.record);
    if (plan_.step) step_.emplace(*plan_.step);
    if (plan_.proof) proof_.emplace([this](uint64_t item) { return steered_->account_of(item); });
    if (plan_.window) open_window();
    try {
      open_display();
    } catch (const Error&) {
      if (interrupted()) return interrupt_exit_code();
      throw;
    }
    if (plan_.sound) {
      const std::string& panel = display_->mode().name;  // "HDMI-A-1 on /dev/dri/card0 ..."
      plan_.sound->start(kms_ != nullptr ? panel.substr(0, panel.find(" on ")) : "");
      plan_.playback.sound = &plan_.sound->clock();
    }
    announce();
    if (flags_.trim) trim_keys_.emplace(plan_.trim);
    PlayResult result;
    do {
      result = source_error_ ? play_card() : play_source();
    } while (continues_after(result));
    return conclude(result);
  }

 private:
  // Display.
  /// Opens the window on the virtual display's pictures. Closing the window ends playback.
  void open_window() {
    const optics::PixelGrid sent = plan_.context.rig->rig().panel.sent_size();
    window_ = std::make_shared<PreviewWindow>(
        plan_.rig_file, frames::FrameGeometry{.width = sent.width, .height = sent.height},
        interrupt_fd());
    plan_.display.recorder = window_;
    plan_.playback.stop_fd = window_->stop_fd();
  }

  /// Opens the display, taking over the output that a previous player left.
  void open_display() {
    std::vector<StoredDescriptor> kept = take_stored_descriptors();
    kept_ = !kept.empty();
    plan_.display.kms.previous = stored_output(std::move(kept));
    if (plan_.display.kms.previous && plan_.display.kms.previous->state.off != 0)
      steered_->begin_off();
    manager_.status("opening " + plan_.display.spec);
    const bool is_panel = display::is_kms_spec(plan_.display.spec);
    // No other process can become the card's DRM master while the service manager holds the card
    // open.
    if (!is_panel || !plan_.display.kms.previous) release_stored();
    if (is_panel)
      open_panel();
    else
      display_ = display::open_display(plan_.display);
    service_.emplace(manager_, kms_);
    kept_ = kms_ != nullptr && manager_.present();
    if (plan_.duration_s)
      end_ = display_->now() + std::chrono::duration_cast<Nanoseconds>(
                                   std::chrono::duration<double>(*plan_.duration_s));
  }

  void open_panel() {
    lost_ = nothing_yet("waiting for the panel");
    panel_.emplace(
        PanelWaitOptions{.kms = display::kms_options_of(plan_.display),
                         .at_start = plan_.panel_at_start,
                         .after_loss = plan_.panel_after_loss,
                         .rig = flags_.rig_or_wall(),
                         .cancel_fd = interrupt_fd(),
                         .report = [this](const PanelWaiting& waiting) { report_waiting(waiting); },
                         .release_stored = [this] { release_stored(); }});
    std::unique_ptr<display::KmsDisplay> opened = panel_->open([this] {
      if (opened_.source) opened_.source->service();
    });
    kms_ = opened.get();
    display_ = std::move(opened);
    reported_.clear();
  }

  [[nodiscard]] ReconnectResult reconnect(const LostDisplay& lost) {
    lost_ = lost.report;
    say("{}: lost\n", lost.report.display);
    if (proof_) proof_->update(*display_, kms_, true);
    steered_->report_state({"no-panel", lost.report.display + ": lost"});
    const ReconnectResult result = panel_->reconnect(*kms_, lost);
    reported_.clear();
    if (result != ReconnectResult::Reconnected) return result;
    kept_ = manager_.present();
    service_->store_again();
    steered_->report_state(run_state());
    reported_exactness_ = kms_->exactness().summary();
    say("{}: back, {}\n", kms_->mode().name, reported_exactness_);
    return result;
  }

  /// Pings the watchdog only while no usable panel is connected. A connected panel that cannot be
  /// opened is an error, so the watchdog is left to restart the service.
  void report_waiting(const PanelWaiting& waiting) {
    const std::string why = waiting.reason.what();
    steered_->report_state({"no-panel", why});
    if (std::exchange(reported_, why) != why) say("waiting for the panel: {}\n", why);
    manager_.status(fmt::format("waiting for the panel{}: {}",
                                waiting.card_shown ? ", test card shown" : "", why));
    if (waiting.panel_missing) manager_.ping();
    look_after_files();
    nlohmann::ordered_json statistics = statistics_json(lost_);
    statistics["panel_missing"] = waiting.panel_missing;
    statistics["test_card_shown"] = waiting.card_shown;
    write_stats(statistics);
  }

  void release_stored() {
    if (std::exchange(kept_, false)) forget_output(manager_);
  }

  // Playback.
  /// Opens the source. In safe mode a source that cannot be opened is shown as an error on a card
  /// instead of ending the run.
  void open_the_source() {
    try {
      steered_->open(opened_);
      source_error_.reset();
    } catch (const Error& error) {
      if (!safe_.on || error.kind() == ErrorKind::Usage) throw;
      source_error_ = error;
    }
  }

  [[nodiscard]] PlayResult play_source() {
    PlaybackOptions options = plan_.playback;
    // The vblanks count from the first frame; in safe mode, several playbacks share them.
    options.vblanks =
        safe_.on ? vblanks_left() : vblanks_of(plan_.duration_s, display_->mode().refresh);
    steered_->prepare(options, display_->mode().refresh);
    if (step_) options.step = &step_->pacing();
    if (proof_) proof_->prepare(options);
    return play_on_display(*opened_.source, options);
  }

  [[nodiscard]] PlayResult play_card() {
    say("{}\n", source_error_->what());
    steered_->report_state({"failed", source_error_->what()});
    service_->set_problem(source_error_->what());
    StillSource card(
        draw_test_card(display_->mode().geometry, error_card(flags_.source, *source_error_)));
    PlaybackOptions options = plan_.playback;
    options.loops = kForever;
    options.prime = 1;
    options.sound = nullptr;
    options.content.reset();
    options.vblanks = whole_vblanks(std::exchange(card_time_, kTryAgain), display_->mode().refresh);
    if (const auto left = vblanks_left()) options.vblanks = std::min(*options.vblanks, *left);
    return play_on_display(card, options);
  }

  [[nodiscard]] PlayResult play_on_display(frames::FrameSource& source, PlaybackOptions options) {
    // 0 = unknown
    Progress progress("playing", "frames", source.frame_count().value_or(0) * options.loops);
    options.on_report = [&](const PlayReport& report) {
      look_after_files();
      if (plan_.sound) plan_.sound->look();
      update_proof();
      steered_->report(report);
      report_stall(report);
      if (step_) step_->report_problem();
      write_stats(statistics_json(report));
      service_->report(report);
      report_power(report);
      report_exactness();
      update_progress(progress, report);
    };
    options.on_turn = [this] { update_proof(); };
    if (panel_) options.reconnect = [this](const LostDisplay& lost) { return reconnect(lost); };
    write_stats(statistics_json(nothing_yet("starting")));
    PlayResult result = play(*display_, source, options);
    update_proof();
    update_progress(progress, result.report);
    progress.finish(outcome_name(result.outcome));
    return result;
  }

  /// Returns true if playback continues. In safe mode the source is tried again after its test
  /// card, and a source that failed is replaced by a card.
  [[nodiscard]] bool continues_after(const PlayResult& result) {
    const bool ended_by_others =
        result.outcome == PlayOutcome::Stopped || result.outcome == PlayOutcome::DisplayLost;
    if (!safe_.on || ended_by_others || interrupted()) return false;
    if (time_is_over()) return false;
    if (source_error_) {
      open_the_source();
      if (!source_error_) service_->set_problem({});
      return true;
    }
    if (result.outcome == PlayOutcome::Finished) return false;
    source_error_ = source_error(result);
    return true;
  }

  [[nodiscard]] std::optional<uint64_t> vblanks_left() const {
    if (!end_) return std::nullopt;
    return whole_vblanks(*end_ - display_->now(), display_->mode().refresh);
  }
  /// Returns true if the requested time is over. A duration in whole vblanks may end up to one
  /// vblank early.
  [[nodiscard]] bool time_is_over() const {
    if (!end_) return false;
    const std::chrono::duration<double> vblank(1.0 / display_->mode().refresh.hertz());
    return *end_ - display_->now() < vblank;
  }

  // Files that are read and written meanwhile.
  /// Called about once a second.
  void look_after_files() {
    if (take_reload_request()) reload();
    if (plan_.trim) plan_.trim->save_again();
    follow_rig();
    std::string warning = outputs_.report_problems();
    for (const std::string& problem : {rig_problem_, stall_})
      if (!problem.empty()) warning += warning.empty() ? problem : ", " + problem;
    if (service_) service_->set_warning(warning);
  }

  void update_proof() {
    if (proof_) proof_->update(*display_, kms_);
  }
  /// Copies a rig that the administrator has edited, if this player uses a copy.
  void copy_edited_rig(bool reloading = false) {
    if (!plan_.rig_store || plan_.rig_file != plan_.rig_store->copy()) return;
    try {
      if (reloading ? plan_.rig_store->update() : plan_.rig_store->update_if_edited())
        say("{}: was edited: it replaces the calibration made during playback\n", flags_.rig);
      store_problem_.clear();
    } catch (const std::exception& error) {
      store_problem_ = error.what();
    }
  }

  void follow_rig() {
    if (!plan_.context.rig) return;
    LiveRig& rig = *plan_.context.rig;
    copy_edited_rig();
    rig.look();
    const std::string complaint = store_problem_.empty() ? rig.complaint() : store_problem_;
    if (std::exchange(rig_problem_, complaint) == complaint) return;
    if (complaint.empty())
      say("{}: can be used again\n", flags_.rig);
    else
      say("{}; the previous rig stays in use\n", complaint);
  }

  void reload() {
    say("reloading: checking rig, list and films for changes\n");
    copy_edited_rig(true);
    if (plan_.context.rig) plan_.context.rig->read_again();
    steered_->look_again();
    outputs_.try_at_once();
  }

  // Reports.
  /// Reports the exactness when it has changed.
  void report_exactness() {
    if (kms_ == nullptr) return;
    const std::string exactness = kms_->exactness().summary();
    if (std::exchange(reported_exactness_, exactness) != exactness)
      say("{}: now {}\n", display_->mode().name, exactness);
  }

  /// Reports that the output was switched, and stores that for the next player.
  void report_power(const PlayReport& report) {
    if (std::exchange(reported_off_, report.off) == report.off) return;
    service_->store_again();
    const std::string exactness = kms_ != nullptr ? ", " + kms_->exactness().summary() : "";
    say("{}: {}{}\n", report.display, report.off ? "switched off" : "switched on again",
        report.off ? "" : exactness);
  }

  /// Reports once that frames no longer come although they are due, and once that they come again.
  /// A panel that is away needs none, and the first frame of a renderer may come at any time.
  void report_stall(const PlayReport& report) {
    StageDelays delays = report.delays;
    if (report.pace.shown == 0 && delays.source_waits_for_others) delays.source = 0;
    const bool away =
        report.off || (kms_ != nullptr && kms_->statistics().panel != display::PanelState::Showing);
    const std::string stage = away ? "" : stalled_stage(delays);
    const auto now = std::chrono::steady_clock::now();
    if (stage.empty() == stall_.empty()) return;
    if (stage.empty()) {
      say("{}: continues after {:.0f} s\n", flags_.source,
          std::chrono::duration<double>(now - stall_begin_).count());
      stall_.clear();
    } else {
      stall_ = fmt::format("{}: {}; the displayed frame stays", flags_.source, stage);
      stall_begin_ = now - std::chrono::seconds(2);
      say("{}\n", stall_);
    }
    steered_->report_state(run_state());
  }
  [[nodiscard]] PlayState run_state() const {
    if (!stall_.empty()) return {"stalled", stall_};
    return source_error_ ? PlayState{"failed", source_error_->what()} : PlayState();
  }

  /// Prints the start message once, for people and the journal.
  void announce() {
    if (kms_ != nullptr) reported_exactness_ = kms_->exactness().summary();
    if (kms_ != nullptr)
      say("{}: {}, {}\n", display_->mode().name, reported_exactness_,
          kms_->took_over() ? "taken over without a modeset" : "started by a modeset");
    if (!source_error_ && !opened_.stall_hint.empty())
      say("playing {} on {}: waiting for a renderer\n", flags_.source, display_->mode().name);
  }

  void write_stats(nlohmann::ordered_json statistics) {
    outputs_.describe_problems(statistics);
    statistics["rig_problem"] = rig_problem_;
    steered_->complete(statistics);
    outputs_.write_statistics(statistics);
  }

  /// Returns the report with the figures of the graphics card and of safe mode.
  [[nodiscard]] nlohmann::ordered_json statistics_json(const PlayReport& report) const {
    nlohmann::ordered_json json = to_json(report);
    if (kms_ != nullptr) {
      json["exactness"] = to_json(kms_->exactness());
      json["kms"] = to_json(kms_->statistics());
      json["kms"]["took_over"] = kms_->took_over();
    }
    if (opened_.source) json.update(to_json(opened_.source->damage()));
    if (std::string name = video_decoder(); !name.empty()) json["video_decoder"] = std::move(name);
    if (const auto warnings = plan_.context.warnings->all(); !warnings.empty())
      json["rig_warnings"] = warnings;
    if (plan_.sound) json["sound"] = plan_.sound->statistics();
    if (proof_) json["proof"] = proof_->statistics();
    if (step_) json["step"] = step_->statistics();
    if (safe_.on) {
      json["safe_start"] = {{"failed_starts", safe_.failures}, {"problem", nullptr}};
      if (source_error_) json["safe_start"]["problem"] = source_error_->what();
    }
    return json;
  }

  [[nodiscard]] std::string video_decoder() const {
    return opened_.source ? opened_.source->video_decoder() : "";
  }
  [[nodiscard]] PlayReport nothing_yet(const char* outcome) const {
    PlayReport report;
    report.source = flags_.source;
    report.display = flags_.display;
    report.outcome = outcome;
    return report;
  }

  // End of the run.
  [[nodiscard]] ExitCode conclude(const PlayResult& result) {
    nlohmann::ordered_json statistics = statistics_json(result.report);
    steered_->complete(statistics);
    manager_.stopping(outcome_name(result.outcome));
    trim_keys_.reset();
    if (plan_.trim) plan_.trim->writes().try_at_once();
    look_after_files();
    service_.reset();
    kms_ = nullptr;
    display_.reset();  // completes the recording
    if (!flags_.record.empty()) statistics["recording"] = outputs_.finish_recording();
    write_stats(statistics);
    outputs_.finish_statistics();
    if (outputs_.incomplete() && result.outcome != PlayOutcome::Finished)
      say("{}\n", outputs_.incomplete()->what());
    if (flags_.json)
      print_json(statistics);
    else
      say("{}\n", Verbatim{summary_text(result.report)});
    if (opened_.source && opened_.source->damage().any())
      say("{}: {}\n", flags_.source, damage_text(opened_.source->damage()));
    if (const std::string name = video_decoder(); !name.empty())
      say("{}: decoded by {}\n", flags_.source, name);
    return exit_code_after(result);
  }

  [[nodiscard]] ExitCode exit_code_after(const PlayResult& result) const {
    switch (result.outcome) {
      case PlayOutcome::Finished:
        if (source_error_) throw Error(*source_error_);
        if (const std::string why = steered_->failure(); !why.empty()) throw list_error(why);
        if (outputs_.incomplete()) throw Error(*outputs_.incomplete());
        return kOk;
      case PlayOutcome::Stopped:
        if (window_) window_->check();
        return outputs_.incomplete() ? kFailed : interrupt_exit_code();
      case PlayOutcome::SourceFailed:
      case PlayOutcome::SourceStalled:
        throw source_error(result);
      case PlayOutcome::DisplayLost:
        throw lost_display();
    }
    return kFailed;
  }

  [[nodiscard]] Error list_error(const std::string& why) const {
    const bool names_its_object = why.find(": ") != std::string::npos;
    return {ErrorKind::Input, names_its_object ? why : fmt::format("{}: {}", flags_.source, why)};
  }
  [[nodiscard]] Error source_error(const PlayResult& result) const {
    if (result.outcome == PlayOutcome::SourceStalled)
      return {ErrorKind::Failed,
              fmt::format("{}: no frame arrived for {} s", flags_.source,
                          *plan_.playback.stall_timeout / seconds(1)),
              opened_.stall_hint};
    if (const std::string why = steered_->failure(); !why.empty()) return list_error(why);
    const bool empty = result.report.filled == 0;
    const bool cannot_loop = opened_.loop_obstacle && !empty;
    return {cannot_loop ? ErrorKind::Failed : ErrorKind::Input,
            fmt::format("{}: {}", flags_.source, result.failure),
            cannot_loop ? opened_.loop_obstacle() : ""};
  }

  [[nodiscard]] Error lost_display() const {
    const std::string what = fmt::format("display '{}': disconnected", flags_.display);
    if (!panel_ || !panel_->refusal()) return {ErrorKind::Device, what};
    return {ErrorKind::Device,
            fmt::format("{} and not reconnected: {}", what, panel_->refusal()->what()),
            panel_->refusal()->hint()};
  }

  const PlayFlags& flags_;
  PlayPlan plan_;
  const ServiceManager& manager_;
  const SafeStart safe_;

  PlayOutputs outputs_;
  std::optional<SteeredPlay> steered_;
  OpenedSource opened_;                ///< destroyed before steered_, which controls it
  std::optional<Error> source_error_;  ///< safe mode: why the source is not played
  display::Nanoseconds card_time_;  ///< display time of the card before the source is tried again
  std::optional<PanelWait> panel_;
  std::shared_ptr<PreviewWindow> window_;  ///< null without --display window
  std::optional<PlayProof> proof_;         ///< none without --proof journal
  std::unique_ptr<display::Display> display_;
  display::KmsDisplay* kms_ = nullptr;  ///< display_, if it is a KMS display
  std::optional<PlayService> service_;
  std::optional<display::Nanoseconds> end_;  ///< end of the requested time, display clock
  bool kept_ = false;  ///< the service manager holds a copy of the card's descriptor
  std::optional<TrimKeys> trim_keys_;
  std::optional<StepLink> step_;  ///< none without --step
  std::string rig_problem_;
  std::string store_problem_;  ///< why an edited rig was not copied
  std::string reported_exactness_;
  bool reported_off_ = false;
  std::string stall_;  ///< why a due frame has not come for two seconds; empty if none is due
  std::chrono::steady_clock::time_point stall_begin_;
  std::string reported_;  ///< the reported reason for waiting; each is reported once
  PlayReport lost_;       ///< the report while waiting for a panel
};

}  // namespace

ExitCode run_player(const PlayFlags& flags, PlayPlan plan, const ServiceManager& manager,
                    SafeStart safe) {
  return PlayRun(flags, std::move(plan), manager, std::move(safe)).run();
}

}  // namespace lenticule::player
