// SPDX-License-Identifier: Apache-2.0
// lenticule play
#include <fmt/format.h>

#include <memory>
#include <optional>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "display/kms/kms_display.h"
#include "display/open_display.h"
#include "frames/atomic_file.h"
#include "player/command.h"
#include "player/interrupt.h"
#include "player/kept_output.h"
#include "player/panel_json.h"
#include "player/panel_wait.h"
#include "player/play_plan.h"
#include "player/play_service.h"
#include "player/playback.h"
#include "player/progress.h"
#include "player/service_manager.h"
#include "player/source_open.h"

namespace lenticule::player {
namespace {

/// The report, and what a graphics card adds to it.
nlohmann::ordered_json statistics_json(const PlayReport& report,
                                       const display::KmsDisplay* display) {
  nlohmann::ordered_json json = to_json(report);
  if (display == nullptr) return json;
  json["exactness"] = to_json(display->exactness());
  json["kms"] = to_json(display->statistics());
  json["kms"]["took_over"] = display->took_over();
  return json;
}

std::string progress_note(const PlayReport& report) {
  return fmt::format("{} underruns, {} missed vblanks, {} dropped", report.pace.underruns,
                     report.pace.missed, report.pace.dropped);
}

/// 0 = nobody knows.
uint64_t frames_to_show(const frames::FrameSource& source, uint64_t loops) {
  return source.frame_count().value_or(0) * loops;
}

/// One run, from the plan to the exit code.
class PlayRun {
 public:
  PlayRun(const PlayFlags& flags, PlayPlan plan, const ServiceManager& manager)
      : flags_(flags), plan_(std::move(plan)), manager_(manager) {}

  ExitCode run() {
    opened_ = open_source(plan_.source);
    if (!flags_.record.empty()) plan_.display.recorder = display::open_recorder(flags_.record);
    try {
      open_display();
    } catch (const Error&) {
      if (interrupted()) return interrupt_exit_code();
      throw;
    }
    announce();
    return conclude(play_on_display());
  }

 private:
  void open_display();
  void open_panel();
  void announce() const;
  PlayResult play_on_display();
  Comeback bring_back(const LostDisplay& lost, PlayService& service);
  ExitCode conclude(const PlayResult& result);
  [[nodiscard]] ExitCode exit_code_after(const PlayResult& result) const;
  void tell_waiting(const PanelWaiting& waiting);
  void let_go();
  [[nodiscard]] Error lost_display() const;
  [[nodiscard]] PlayReport nothing_yet(const char* outcome) const;
  void write_stats(const nlohmann::ordered_json& statistics) const;

  const PlayFlags& flags_;
  PlayPlan plan_;
  const ServiceManager& manager_;
  OpenedSource opened_;
  std::optional<PanelWait> panel_;
  std::unique_ptr<display::Display> display_;
  display::KmsDisplay* kms_ = nullptr;  ///< display_, if it is one
  bool kept_ = false;                   ///< the manager has a copy of the card
  std::string told_;                    ///< why it waits, said once
  PlayReport lost_;                     ///< while a lost display is waited for
};

void PlayRun::write_stats(const nlohmann::ordered_json& statistics) const {
  if (flags_.stats.empty()) return;
  const std::string text = statistics.dump(2) + "\n";
  frames::write_file_atomically(
      flags_.stats, std::span(reinterpret_cast<const uint8_t*>(text.data()), text.size()));
}

PlayReport PlayRun::nothing_yet(const char* outcome) const {
  PlayReport report;
  report.source = flags_.source;
  report.display = flags_.display;
  report.outcome = outcome;
  return report;
}

/// Opens the display, taking over what a player before us left there.
void PlayRun::open_display() {
  std::vector<KeptDescriptor> kept = take_kept_descriptors();
  kept_ = !kept.empty();
  plan_.display.kms.inherited = kept_output(std::move(kept));
  manager_.status("opening " + plan_.display.spec);
  const bool of_use = plan_.display.kms.inherited && display::is_kms_spec(plan_.display.spec);
  // While the manager has the card open, nobody else can be its master.
  if (kept_ && !of_use) let_go();
  if (display::is_kms_spec(plan_.display.spec))
    open_panel();
  else
    display_ = display::open_display(plan_.display);
  plan_.playback.vblanks = vblanks_of(plan_.duration_s, display_->mode().refresh);
}

void PlayRun::let_go() {
  if (std::exchange(kept_, false)) forget_output(manager_);
}

void PlayRun::open_panel() {
  lost_ = nothing_yet("waiting for the panel");
  panel_.emplace(
      PanelWaitOptions{.kms = display::kms_options_of(plan_.display),
                       .at_start = plan_.panel_at_start,
                       .after_loss = plan_.panel_after_loss,
                       .rig = flags_.rig,
                       .cancel_fd = interrupt_fd(),
                       .tell = [this](const PanelWaiting& waiting) { tell_waiting(waiting); },
                       .let_go = [this] { let_go(); }});
  std::unique_ptr<display::KmsDisplay> opened = panel_->open([this] { opened_.source->service(); });
  kms_ = opened.get();
  display_ = std::move(opened);
  told_.clear();
}

/// Pings only where there is nothing to show on: a panel that is there and cannot be used is not in
/// order, and another process may have better luck.
void PlayRun::tell_waiting(const PanelWaiting& waiting) {
  const std::string why = waiting.reason.what();
  if (std::exchange(told_, why) != why) fmt::print(stderr, "waiting for the panel: {}\n", why);
  manager_.status(fmt::format("waiting for the panel{}: {}",
                              waiting.card_shown ? ", test card shown" : "", why));
  if (waiting.panel_missing) manager_.ping();
  nlohmann::ordered_json statistics = statistics_json(lost_, kms_);
  statistics["waiting_for"] = {{"reason", why},
                               {"panel_missing", waiting.panel_missing},
                               {"test_card_shown", waiting.card_shown}};
  write_stats(statistics);
}

Comeback PlayRun::bring_back(const LostDisplay& lost, PlayService& service) {
  lost_ = lost.report;
  fmt::print(stderr, "{}: lost\n", lost.report.display);
  const Comeback comeback = panel_->bring_back(*kms_, lost);
  told_.clear();
  if (comeback != Comeback::Back) return comeback;
  kept_ = manager_.present();
  service.keep_again();
  fmt::print(stderr, "{}: back, {}\n", kms_->mode().name, kms_->exactness().summary());
  return comeback;
}

/// Once, for people and the journal.
void PlayRun::announce() const {
  if (kms_ != nullptr)
    fmt::print(stderr, "{}: {}, {}\n", display_->mode().name, kms_->exactness().summary(),
               kms_->took_over() ? "taken over without a modeset" : "lit by a modeset");
  if (!opened_.stall_hint.empty())
    fmt::print(stderr, "playing {} on {}: waiting for a renderer\n", flags_.source,
               display_->mode().name);
}

PlayResult PlayRun::play_on_display() {
  PlayService service(manager_, kms_);
  kept_ = kms_ != nullptr && manager_.present();
  Progress progress("playing", "frames", frames_to_show(*opened_.source, plan_.playback.loops));
  PlaybackOptions options = plan_.playback;
  options.on_report = [&](const PlayReport& report) {
    write_stats(statistics_json(report, kms_));
    service.report(report);
    progress.update(report.pace.shown, progress_note(report));
  };
  if (panel_)
    options.bring_back = [&](const LostDisplay& lost) { return bring_back(lost, service); };
  // A place that cannot be written is found out now, not after an evening's playing.
  write_stats(statistics_json(nothing_yet("starting"), kms_));
  PlayResult result = play(*display_, *opened_.source, options);
  progress.update(result.report.pace.shown, progress_note(result.report));
  progress.finish(outcome_name(result.outcome));
  return result;
}

ExitCode PlayRun::conclude(const PlayResult& result) {
  const nlohmann::ordered_json statistics = statistics_json(result.report, kms_);
  manager_.stopping(outcome_name(result.outcome));
  kms_ = nullptr;
  display_.reset();  // completes the recording
  if (plan_.display.recorder) plan_.display.recorder->finish();
  write_stats(statistics);
  if (flags_.json)
    print_json(statistics);
  else
    fmt::print(stderr, "{}\n", summary_text(result.report));
  return exit_code_after(result);
}

ExitCode PlayRun::exit_code_after(const PlayResult& result) const {
  const auto fail = [&](ErrorKind kind, const std::string& what, const std::string& hint = {}) {
    throw Error(kind, fmt::format("{}: {}", flags_.source, what), hint);
  };
  switch (result.outcome) {
    case PlayOutcome::Finished:
      return kOk;
    case PlayOutcome::Stopped:
      return interrupt_exit_code();
    case PlayOutcome::SourceFailed: {
      const std::string obstacle = opened_.loop_obstacle ? opened_.loop_obstacle() : "";
      fail(opened_.loop_obstacle ? ErrorKind::Failed : ErrorKind::Input, result.failure, obstacle);
      break;
    }
    case PlayOutcome::SourceStalled:
      fail(ErrorKind::Failed, fmt::format("no frame came for {} s", flags_.wait),
           opened_.stall_hint);
      break;
    case PlayOutcome::DisplayLost:
      throw lost_display();
  }
  return kFailed;
}

Error PlayRun::lost_display() const {
  const std::string what = fmt::format("display '{}': it went away", flags_.display);
  if (!panel_ || !panel_->refusal()) return {ErrorKind::Device, what};
  return {ErrorKind::Device,
          fmt::format("{} and did not come back: {}", what, panel_->refusal()->what()),
          panel_->refusal()->hint()};
}

ExitCode run_play(const PlayFlags& flags) {
  const ServiceManager manager;
  return PlayRun(flags, make_plan(flags, manager.present()), manager).run();
}

}  // namespace

Run declare_play(CLI::App& app) {
  const auto flags = std::make_shared<PlayFlags>();
  declare_flags(app, *flags);
  return [flags] { return run_play(*flags); };
}

}  // namespace lenticule::player
