// SPDX-License-Identifier: Apache-2.0
// lenticule play
#include <fmt/format.h>

#include <charconv>
#include <chrono>
#include <cmath>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "display/kms/kms_display.h"
#include "display/open_display.h"
#include "frames/atomic_file.h"
#include "optics/rig_file.h"
#include "player/command.h"
#include "player/interrupt.h"
#include "player/kept_output.h"
#include "player/panel_json.h"
#include "player/play_service.h"
#include "player/playback.h"
#include "player/progress.h"
#include "player/service_manager.h"
#include "player/source_open.h"

namespace lenticule::player {
namespace {

using SteadyClock = std::chrono::steady_clock;

constexpr auto kLongestPriming = std::chrono::hours(24);           // with --wait forever
constexpr auto kLongestPanelWait = std::chrono::hours(24 * 3650);  // with --wait-for-panel forever

/// As given on the command line.
struct PlayFlags {
  std::string source;
  std::string rig;
  std::string display = "virtual";
  std::string clock = "real";
  std::string fps;
  std::string loop;
  std::string late = "slip";
  std::string frames;
  std::string record;
  std::string stats;
  std::string wait = "60";
  std::string wait_for_panel = "0";
  std::string on_exit;
  std::optional<double> duration_s;
  std::optional<uint64_t> prime;
  int slots = 8;
  int buffers = 3;
  bool json = false;
  SteadyClock::time_point started = SteadyClock::now();
};

void declare_flags(CLI::App& app, PlayFlags& flags) {
  app.add_option("source", flags.source, "ring:SOCKET, a pattern such as 'out/%05d.png', a picture")
      ->required();
  app.add_option("--rig", flags.rig, "the rig that the frames are woven for")->required();
  app.add_option("--display", flags.display,
                 "kms, kms:CONNECTOR, kms:edid:MFG[:PRODUCT[:SERIAL]], kms:/dev/dri/..., or "
                 "virtual, virtual:3840x2160@60, virtual:3840x2160@59.94,jitter_us=500")
      ->capture_default_str();
  app.add_option("--clock", flags.clock,
                 "of a virtual display: real, or simulated (as fast as the source can)")
      ->check(CLI::IsMember({"real", "simulated"}))
      ->capture_default_str();
  app.add_option("--fps", flags.fps, "content rate: 24, 59.94, 24000/1001 (default: the source's)");
  app.add_option("--loop", flags.loop, "play N times, or forever (default 1)");
  app.add_option("--late", flags.late, "what to do about late frames: slip, drop or hold")
      ->capture_default_str();
  app.add_option("--frames", flags.frames, "A:B, only these frames of a pattern");
  app.add_option("--duration", flags.duration_s,
                 "stop after so many seconds; without --loop, loop until then")
      ->check(CLI::PositiveNumber);
  app.add_option("--prime", flags.prime,
                 "frames that must be ready before the first is shown, waiting for them as long as "
                 "--wait says (default: half of the slots, or what came within two seconds)")
      ->check(CLI::Range(1, 1'000'000));
  app.add_option("--slots", flags.slots, "frames kept ready in memory")
      ->check(CLI::Range(2, 4096))
      ->capture_default_str();
  app.add_option("--buffers", flags.buffers, "scan-out buffers")
      ->check(CLI::Range(2, 16))
      ->capture_default_str();
  app.add_option("--wait", flags.wait, "give up when no frame came for so many seconds, or forever")
      ->capture_default_str();
  app.add_option("--wait-for-panel", flags.wait_for_panel,
                 "with kms: wait so many seconds, or forever, for a panel that is not there")
      ->capture_default_str();
  app.add_option(
         "--on-exit", flags.on_exit,
         "with kms: restore what was shown before, hold the last frame for the next player, "
         "or black (default: hold as a service, else restore)")
      ->check(CLI::IsMember({"restore", "hold", "black"}));
  app.add_option("--record", flags.record,
                 "record what was on the glass: checksums:FILE or png:FOLDER");
  app.add_option("--stats", flags.stats, "write statistics there, every second and at the end");
  app.add_flag("--json", flags.json, "print the statistics as JSON at the end");
}

uint64_t parse_loops(const PlayFlags& flags) {
  if (flags.loop.empty()) return flags.duration_s ? kForever : 1;
  if (flags.loop == "forever") return kForever;
  uint64_t loops = 0;
  const char* const last = flags.loop.data() + flags.loop.size();
  const auto [end, error] = std::from_chars(flags.loop.data(), last, loops);
  if (error == std::errc() && end == last && loops > 0) return loops;
  throw Error(ErrorKind::Usage, fmt::format("--loop '{}': not a number of loops", flags.loop),
              "write a number from 1 on, or forever");
}

/// None = forever.
std::optional<std::chrono::nanoseconds> parse_wait(const char* flag, const std::string& text,
                                                   uint32_t least) {
  if (text == "forever") return std::nullopt;
  uint32_t seconds = 0;
  const char* const last = text.data() + text.size();
  const auto [end, error] = std::from_chars(text.data(), last, seconds);
  if (error == std::errc() && end == last && seconds >= least) return std::chrono::seconds(seconds);
  throw Error(ErrorKind::Usage, fmt::format("{} '{}': not a number of seconds", flag, text),
              fmt::format("write a number from {} on, or forever", least));
}

display::ExitPolicy exit_policy(const std::string& on_exit, bool service) {
  if (on_exit == "black") return display::ExitPolicy::Black;
  if (on_exit == "hold" || (on_exit.empty() && service)) return display::ExitPolicy::Hold;
  return display::ExitPolicy::Restore;
}

/// Whole vblanks within the duration, at least one.
std::optional<uint64_t> vblanks_of(std::optional<double> duration_s, frames::Rate refresh) {
  constexpr double kMaxDurationS = 1e9;
  if (!duration_s) return std::nullopt;
  if (!(*duration_s <= kMaxDurationS))
    throw Error(ErrorKind::Usage, fmt::format("--duration {}: too long", *duration_s),
                "use --loop forever");
  return std::max<uint64_t>(1, static_cast<uint64_t>(*duration_s * refresh.hertz()));
}

/// What the flags mean, before anything is opened.
struct Plan {
  SourceRequest source;
  display::DisplayRequest display;
  PlaybackOptions playback;
};

/// What a KMS display needs to know beside its name.
display::KmsOptions kms_options(const PlayFlags& flags, const optics::Rig& rig, bool service) {
  if (!flags.record.empty())
    throw Error(ErrorKind::Usage, "--record: a graphics card does not tell what it showed",
                "record with --display virtual");
  if (flags.clock != "real")
    throw Error(ErrorKind::Usage, "--clock: a panel has a clock of its own",
                "simulate with --display virtual");
  display::KmsOptions options;
  options.wish.identity = rig.identity;
  options.exit = exit_policy(flags.on_exit, service);
  options.wait_for_panel =
      parse_wait("--wait-for-panel", flags.wait_for_panel, 0).value_or(kLongestPanelWait);
  options.cancel_fd = interrupt_fd();
  return options;
}

Plan make_plan(const PlayFlags& flags, bool service) {
  Plan plan;
  plan.playback.loops = parse_loops(flags);
  plan.playback.late = parse_late_policy(flags.late);
  plan.playback.stall_timeout = parse_wait("--wait", flags.wait, 1);
  plan.playback.prime = flags.prime.value_or(std::max(1, flags.slots / 2));
  if (flags.prime)  // who asks for so many frames means to wait for them
    plan.playback.prime_timeout = plan.playback.stall_timeout.value_or(kLongestPriming);
  plan.playback.started = flags.started;
  plan.playback.source_name = flags.source;
  plan.playback.stop_fd = interrupt_fd();
  if (!flags.fps.empty()) plan.playback.content = frames::parse_rate(flags.fps);
  if (flags.clock == "simulated") {
    plan.display.clock = std::make_shared<display::SimulatedClock>();
    plan.playback.filling = Filling::InPresenter;
  } else {
    plan.playback.real_time_priority = true;
  }
  plan.display.spec = flags.display;
  plan.display.buffers = flags.buffers;
  display::check_display_spec(flags.display);
  plan.source.text = flags.source;
  plan.source.slots = flags.slots;
  plan.source.plays_again = plan.playback.loops != 1;
  if (!flags.frames.empty()) plan.source.frames = parse_frame_range(flags.frames);

  const optics::Rig rig = optics::load_rig(flags.rig);
  plan.source.panel = {.width = rig.panel.width_px, .height = rig.panel.height_px};
  plan.source.rig_fingerprint = optics::fingerprint(rig);
  plan.display.panel = plan.source.panel;
  if (display::is_kms_spec(flags.display)) plan.display.kms = kms_options(flags, rig, service);
  return plan;
}

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

void write_stats(const std::string& file, const nlohmann::ordered_json& statistics) {
  if (file.empty()) return;
  const std::string text = statistics.dump(2) + "\n";
  frames::write_file_atomically(
      file, std::span(reinterpret_cast<const uint8_t*>(text.data()), text.size()));
}

std::string progress_note(const PlayReport& report) {
  return fmt::format("{} underruns, {} missed vblanks, {} dropped", report.pace.underruns,
                     report.pace.missed, report.pace.dropped);
}

/// 0 = nobody knows.
uint64_t frames_to_show(const frames::FrameSource& source, uint64_t loops) {
  return source.frame_count().value_or(0) * loops;
}

ExitCode exit_code_after(const PlayResult& result, const OpenedSource& opened,
                         const PlayFlags& flags) {
  const auto fail = [&](ErrorKind kind, const std::string& what, const std::string& hint = {}) {
    throw Error(kind, fmt::format("{}: {}", flags.source, what), hint);
  };
  switch (result.outcome) {
    case PlayOutcome::Finished:
      return kOk;
    case PlayOutcome::Stopped:
      return interrupt_exit_code();
    case PlayOutcome::SourceFailed: {
      const std::string obstacle = opened.loop_obstacle ? opened.loop_obstacle() : "";
      fail(opened.loop_obstacle ? ErrorKind::Failed : ErrorKind::Input, result.failure, obstacle);
      break;
    }
    case PlayOutcome::SourceStalled:
      fail(ErrorKind::Failed, fmt::format("no frame came for {} s", flags.wait), opened.stall_hint);
      break;
    case PlayOutcome::DisplayLost:
      throw Error(ErrorKind::Device, fmt::format("display '{}': it went away", flags.display));
  }
  return kFailed;
}

/// Opens the display, taking over what a player before us left there.
std::unique_ptr<display::Display> open_output(const display::DisplayRequest& wanted,
                                              const ServiceManager& manager) {
  display::DisplayRequest request = wanted;
  std::vector<KeptDescriptor> kept = take_kept_descriptors();
  const bool any_kept = !kept.empty();
  request.kms.inherited = kept_output(std::move(kept));
  if (any_kept && (!request.kms.inherited || !display::is_kms_spec(request.spec)))
    forget_output(manager);  // while the manager has the card open, nobody else can be its master
  manager.status("opening " + request.spec);
  return display::open_display(request);
}

/// Once, for people and the journal.
void announce(const PlayFlags& flags, const OpenedSource& opened, const display::Display& display,
              const display::KmsDisplay* kms) {
  if (kms != nullptr)
    fmt::print(stderr, "{}: {}, {}\n", display.mode().name, kms->exactness().summary(),
               kms->took_over() ? "taken over without a modeset" : "lit by a modeset");
  if (!opened.stall_hint.empty())
    fmt::print(stderr, "playing {} on {}: waiting for a renderer\n", flags.source,
               display.mode().name);
}

ExitCode run_play(const PlayFlags& flags) {
  const ServiceManager manager;
  Plan plan = make_plan(flags, manager.present());
  OpenedSource opened = open_source(plan.source);
  if (!flags.record.empty()) plan.display.recorder = display::open_recorder(flags.record);
  std::unique_ptr<display::Display> display;
  try {
    display = open_output(plan.display, manager);
  } catch (const Error&) {
    if (interrupted()) return interrupt_exit_code();
    throw;
  }
  const auto* const kms = dynamic_cast<const display::KmsDisplay*>(display.get());
  announce(flags, opened, *display, kms);
  plan.playback.vblanks = vblanks_of(flags.duration_s, display->mode().refresh);

  PlayService service(manager, kms);
  Progress progress("playing", "frames", frames_to_show(*opened.source, plan.playback.loops));
  plan.playback.on_report = [&](const PlayReport& report) {
    write_stats(flags.stats, statistics_json(report, kms));
    service.report(report);
    progress.update(report.pace.shown, progress_note(report));
  };
  // A place that cannot be written is found out now, not after an evening's playing.
  PlayReport nothing_yet;
  nothing_yet.source = flags.source;
  nothing_yet.outcome = "starting";
  write_stats(flags.stats, statistics_json(nothing_yet, kms));

  const PlayResult result = play(*display, *opened.source, plan.playback);
  const nlohmann::ordered_json statistics = statistics_json(result.report, kms);
  manager.stopping(outcome_name(result.outcome));
  progress.update(result.report.pace.shown, progress_note(result.report));
  progress.finish(outcome_name(result.outcome));
  display.reset();  // completes the recording
  if (plan.display.recorder) plan.display.recorder->finish();
  write_stats(flags.stats, statistics);
  if (flags.json)
    print_json(statistics);
  else
    fmt::print(stderr, "{}\n", summary_text(result.report));
  return exit_code_after(result, opened, flags);
}

}  // namespace

Run declare_play(CLI::App& app) {
  const auto flags = std::make_shared<PlayFlags>();
  declare_flags(app, *flags);
  return [flags] { return run_play(*flags); };
}

}  // namespace lenticule::player
