// SPDX-License-Identifier: Apache-2.0
// lenticule play plays a source on a display.

#include <CLI/CLI.hpp>
#include <memory>
#include <optional>
#include <string>
#include <utility>

#include "apps/lenticule/cli/command.h"
#include "apps/lenticule/cli/content_flags.h"
#include "apps/lenticule/cli/option.h"
#include "base/error.h"
#include "base/print.h"
#include "player/process/interrupt.h"
#include "player/process/private_folder.h"
#include "player/process/rig_choice.h"
#include "player/session/play_plan.h"
#include "player/session/play_run.h"
#include "player/session/play_service.h"

namespace lenticule::cli {
namespace {

using player::PlayFlags;

/// Number of recent failed starts after which the player starts in safe mode.
constexpr int kFailuresUntilSafe = 5;
/// Number of failed starts, with those in safe mode, after which the source is suspected.
constexpr int kFailuresUntilCard = 10;

player::SafeStart safe_start(const PlayFlags& flags, const player::StartHistory& history) {
  const int failures = history.failures();
  return {.on = flags.safe || failures >= kFailuresUntilSafe,
          .card_first = failures >= kFailuresUntilCard,
          .failures = failures,
          .last_reason = history.last_reason()};
}

ExitCode play_with(const PlayFlags& flags, const player::ServiceManager& manager,
                   const player::SafeStart& safe) {
  if (safe.failures >= kFailuresUntilSafe)
    say("{} starts failed within two minutes: starting in safe mode\n", safe.failures);
  if (!safe.on)
    return player::run_player(flags, make_plan(flags, manager.present()), manager, safe);
  std::optional<player::PlayPlan> plan = plan_when_rig_is_right(flags, manager);
  if (!plan) return player::interrupt_exit_code();
  return player::run_player(flags, std::move(*plan), manager, safe);
}

/// Sets the rig of the flags unless a wall has the rigs. Waits for a panel as long as a player
/// does; none when interrupted.
std::optional<player::ChosenRig> choose_rig_of(PlayFlags& flags,
                                               const player::ServiceManager& manager) {
  if (!flags.wall.empty()) return player::ChosenRig{};
  std::string reported;
  const auto report = [&](const Error& reason) {
    if (std::exchange(reported, reason.what()) != reason.what())
      say("waiting for the panel: {}\n", reason.what());
    manager.status(std::string("waiting for the panel: ") + reason.what());
    manager.ping();
  };
  std::optional<player::ChosenRig> rig = player::choose_rig_when_connected(
      {.given = flags.rig, .display = flags.display, .source = flags.source},
      player::panel_wait_at_start(flags, manager.present()), report);
  if (!rig) return std::nullopt;
  flags.rig_of_film = rig->kept != nullptr;
  if (flags.rig_of_film && flags.trim)
    throw Error(ErrorKind::Usage, "--trim: cannot be saved in the rig that a film contains",
                "add --rig RIG.toml");
  flags.rig = rig->file;
  return rig;
}

ExitCode run_play(PlayFlags& flags) {
  const player::ServiceManager manager;
  if (flags.preflight) {
    const auto rig = choose_rig_of(flags, manager);
    return rig ? run_preflight(flags, make_plan(flags, false)) : player::interrupt_exit_code();
  }
  check_display_choice(flags, manager.present());
  const bool may_reload = manager.present() || !flags.control.empty();
  if (may_reload && !player::has_terminal()) player::reload_at_hangup();
  player::StartHistory history(player::runtime_folder(), player::time_since_boot());
  try {
    const auto rig = choose_rig_of(flags, manager);
    const ExitCode code =
        rig ? play_with(flags, manager, safe_start(flags, history)) : player::interrupt_exit_code();
    history.ended_well();
    return code;
  } catch (const Error& error) {
    history.failed(error.what());
    throw;
  }
}

/// Declares the flags that most users need.
CLI::Option* declare_first_flags(CLI::App& app, PlayFlags& flags) {
  app.add_option(
         "SOURCE", flags.source,
         "FILE.lts, pictures ('out/%05d.png'), a video, quilts, LIST.toml, .m3u or .json, FOLDER/, "
         "ring:SOCKET, v4l2:DEVICE, card or views\n"
         "Live: v4l2:/dev/video0 (a camera or grabber, with --stereo, --grid or --depth), "
         "v4l2:/dev/video0,/dev/video2 (left and right). Woven frames: ring:SOCKET, a sequence "
         "FILE.lts, a pattern such as 'out/%05d.png', "
         "a picture, a video. Views, which are woven during playback: a quilt, a pattern or "
         "a video of quilts (NAME_qs8x6a0.75.png), stereo (NAME_sbs.mkv), depth "
         "(NAME_rgbd.png), 'views:view%02d.png'. LIST.toml is a playlist, FOLDER/ stands for "
         "its files, card is a test card, views shows the rig's views by their numbers.")
      ->required();
  CLI::Option* const rig =
      declare_rig_flag(app, flags.rig, "the rig that the frames are woven for")
          ->default_str(
              "that of the connected panel; on a virtual display the film's, or a sample");
  add_option(app, "--display DISPLAY", flags.display,
             "kms (a panel), kms:CONNECTOR, virtual, virtual:3840x2160@60, or window\n"
             "Also kms:edid:MFG[:PRODUCT[:SERIAL]], kms:/dev/dri/..., and "
             "virtual:3840x2160@59.94,jitter_us=500. A window shows what two eyes see of a "
             "virtual display, at the mouse.")
      ->each([&flags](const std::string&) { flags.display_named = true; });
  add_option(app, "--fps RATE", flags.fps, "content rate: 24, 59.94 or 24000/1001")
      ->default_str("the source's");
  add_option(app, "--loop N|forever", flags.loop,
             "play so many times; a picture then stays 10 s each time")
      ->default_str("1, a picture until it is ended");
  add_option(app, "--frames A:B", flags.frames, "play only frames A to B - 1 of a pattern");
  add_option(app, "--duration SECONDS", flags.duration_s,
             "stop then; without --loop, loop until then")
      ->check(CLI::PositiveNumber);
  app.add_flag(
      "--trim", flags.trim,
      "trim the rig with the arrow keys of the terminal while playing\n"
      "Left and right slide the picture by 0.01 lens, up and down change the pitch by "
      "1e-5; with shift (or H J K L) ten times as much, with ctrl a tenth; escape undoes "
      "all changes. Saved in RIG.trim.toml. Views that are woven here follow at once; other "
      "frames must be rendered or woven again.");
  add_option(app, "--control SOCKET", flags.control,
             "listen on this Unix socket for 'lenticule ctl'");
  add_option(app, "--stats FILE", flags.stats,
             "write statistics to this file, every second and at the end");
  app.add_flag("--json", flags.json, "print the statistics as JSON at the end");
  return rig;
}

void declare_display_flags(CLI::App& app, PlayFlags& flags, CLI::Option* rig) {
  app.option_defaults()->group("Display");
  add_option(app, "--wall WALL.toml", flags.wall,
             "instead of --rig: the panels of a wall, on one graphics card\n"
             "FILM.lts then means FILM-PANEL.lts for each panel, and one commit changes all of "
             "them.")
      ->excludes(rig);
  add_option(app, "--clock", flags.clock,
             "clock of a virtual display; simulated: as fast as the source can")
      ->check(CLI::IsMember({"real", "simulated"}));
  add_option(app, "--buffers", flags.buffers, "scan-out buffers")->check(CLI::Range(2, 16));
  app.add_flag("--allow-inexact", flags.allow_inexact,
               "with kms: show frames even if subpixels are known to arrive changed\n"
               "'lenticule doctor' reports what changes them.");
  add_option(app, "--video-decoder", flags.video_decoder,
             "auto: decode videos of views in hardware where the machine can")
      ->check(CLI::IsMember({"auto", "software"}));
}

void declare_sound_flags(CLI::App& app, PlayFlags& flags) {
  app.option_defaults()->group("Sound");
  add_option(app, "--sound FILE|none", flags.sound,
             "file with the sound of SOURCE; none: play silently\n"
             "By default FILM.opus, .flac, .wav, .m4a, .mp3 or .ogg beside FILM.lts, else the "
             "sound of a video.");
  add_option(app, "--sound-device DEVICE", flags.sound_device,
             "auto: that of the panel's own connector; none; an ALSA device; or file:OUT.wav\n"
             "'aplay -L' lists the devices. With auto, films stay silent until there is one.")
      ->default_str("auto, on a virtual display none");
  add_option(app, "--sound-track LANGUAGE|N", flags.sound_track,
             "language (de) or number of the stream, for films with several");
  add_option(app, "--sound-delay MS", flags.sound_delay_ms,
             "play the sound so much later, as the panel shows its pictures later")
      ->check(CLI::Range(-500.0, 500.0));
  add_option(app, "--volume DB", flags.volume_db, "decibels; 0 leaves the sound as it is")
      ->check(CLI::Range(player::kLeastVolumeDb, player::kMostVolumeDb));
}

void declare_timing_flags(CLI::App& app, PlayFlags& flags) {
  app.option_defaults()->group("Timing");
  add_option(app, "--late slip|drop|hold", flags.late, "what to do about late frames");
  add_option(app, "--wait SECONDS|forever", flags.wait, "give up if no frame arrives for so long")
      ->default_str("60; forever for files that repeat, with --control, and for a list");
  app.add_option("--prime", flags.prime,
                 "frames that must be ready before the first is shown\n"
                 "--wait limits the time. By default half of the slots, or what arrived within two "
                 "seconds.")
      ->check(CLI::Range(1, 1'000'000));
  add_option(app, "--slots", flags.slots, "frames kept ready in memory")
      ->check(CLI::Range(2, 4096));
  add_option(app, "--memory MIB", flags.memory_mib,
             "instead of --slots: memory for frames that are decoded ahead\n"
             "Shared by the current item, the next item and the one that ends.")
      ->check(CLI::Range(1, 1 << 20));
}

void declare_step_flags(CLI::App& app, PlayFlags& flags) {
  app.option_defaults()->group("Players in step");
  add_option(app, "--step GROUP", flags.step,
             "play in step with the other players of this group\n"
             "Each frame appears on all panels within one vblank (--late drop is implied). "
             "Example: lenticule play film.lts --rig wall-1.toml --display kms --loop forever "
             "--step wall --leader --step-address 192.168.1.20:7070 --step-key step.key; the "
             "others have --follow.");
  app.add_flag("--leader", flags.leader, "be the one player that states the times");
  app.add_flag("--follow", flags.follow, "follow the leader");
  add_option(app, "--step-address ADDRESS:PORT|PATH", flags.step_address,
             "the leader's address, or a Unix socket for players of one machine");
  add_option(app, "--step-key FILE", flags.step_key,
             "32 or more random bytes, the same for the whole group\n"
             "Optional with a Unix socket.");
}

void declare_control_flags(CLI::App& app, PlayFlags& flags) {
  app.option_defaults()->group("Control and statistics");
  add_option(app, "--control-group GROUP", flags.control_group,
             "members of this group may control the player, as well as its user and root");
  add_option(app, "--record KIND:PATH", flags.record,
             "record the frames of a virtual display: checksums:FILE, times:FILE or png:FOLDER");
  app.add_option("--proof", flags.proof,
                 "where to write the proof of play for 'lenticule report'\n"
                 "An entry at the start and the end of each item.")
      ->check(CLI::IsMember({"journal", "off"}))
      ->default_str("journal as a service, else off");
  app.add_flag("--preflight", flags.preflight,
               "play nothing: report whether disk and decoder keep up\n"
               "Reads the source, or each item of a list, for some seconds; exit code 5 if not.");
}

void declare_service_flags(CLI::App& app, PlayFlags& flags, CLI::Option* rig) {
  app.option_defaults()->group("Service");
  add_option(app, "--wait-for-panel SECONDS|forever", flags.wait_for_panel,
             "with kms: wait so long for a panel that is missing or was lost\n"
             "Another panel shows a test card meanwhile. By default forever as a service; "
             "otherwise 0 at the start and 10 after a loss.");
  app.add_option("--on-exit", flags.on_exit,
                 "with kms: what to leave on the panel\n"
                 "restore: what was shown before; hold: the last frame, for the next player.")
      ->check(CLI::IsMember({"restore", "hold", "black"}))
      ->default_str("hold as a service, else restore");
  add_option(app, "--rig-store FILE", flags.rig_store,
             "save trims and calibrations in this copy of the rig\n"
             "It is used until the file of --rig is edited.")
      ->needs(rig);
  app.add_flag(
      "--safe", flags.safe,
      "start in safe mode\n"
      "Take nothing over from the previous player, use no real-time priority, and show a "
      "test card with the reason while the source cannot be played. A service does this by "
      "itself after five failed starts.");
}

}  // namespace

Run declare_play(CLI::App& app) {
  const auto flags = std::make_shared<PlayFlags>();
  CLI::Option* const rig = declare_first_flags(app, *flags);
  declare_content_flags(app, flags->content);
  declare_weaving_flags(app, flags->weaving);
  declare_display_flags(app, *flags, rig);
  declare_sound_flags(app, *flags);
  declare_timing_flags(app, *flags);
  declare_step_flags(app, *flags);
  declare_control_flags(app, *flags);
  declare_service_flags(app, *flags, rig);
  return [flags] { return run_play(*flags); };
}

}  // namespace lenticule::cli
