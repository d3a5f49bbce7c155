// SPDX-License-Identifier: Apache-2.0
#include "player/session/play_plan.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "base/error_kinds.h"
#include "base/numbers.h"
#include "base/print.h"
#include "display/kms/inspect.h"
#include "display/scanout_format.h"
#include "optics/trim.h"
#include "optics/wall/wall.h"
#include "player/control/control_server.h"
#include "player/process/interrupt.h"
#include "player/session/panel_card.h"

namespace lenticule::player {
namespace {

[[noreturn]] void refuse_flag(const std::string& what, const std::string& hint) {
  throw Error(ErrorKind::Usage, what, hint);
}

// plan_wall plans how one player shows the panels of a wall that are connected to one graphics
// card: each plays its own film, and one commit changes all of them.

/// Drivers accept buffers of at most this width: one row of panels ends there.
constexpr int kWidestRow = 16384;

void refuse_flags_of_one_rig(const PlayFlags& flags, const PlayPlan& plan) {
  for (const auto& [flag, is_set] :
       {std::pair("--rig-store", !flags.rig_store.empty()), std::pair("--trim", flags.trim),
        std::pair("--display window", plan.window)})
    if (is_set)
      refuse_flag(std::string(flag) + ": needs one rig, and a wall has several",
                  "use a player for each panel: --rig, and --step for the same moment");
}

void require_equal_bits(const optics::PlacedPanel& a, const optics::PlacedPanel& b) {
  const int bits_a = a.trimmed.rig.panel.bits, bits_b = b.trimmed.rig.panel.bits;
  if (bits_a == bits_b) return;
  throw input_error("panel '{}' has {} bits per colour, and panel '{}' has {}", a.name, bits_a,
                    b.name, bits_b)
      .remedy("set panel.bits of both rigs to 8, or use a player for each panel");
}

/// Places a panel in the buffer beside the one before, `last`, or in a new row. `size` is that of
/// the buffer.
void place_beside(const display::ScanoutPart& last, display::ScanoutPart& part,
                  frames::FrameGeometry& size) {
  part.left_px = last.left_px + last.geometry.width;
  part.top_px = last.top_px;
  if (part.left_px > 0 && part.left_px + part.geometry.width > kWidestRow) {
    part.left_px = 0;
    part.top_px = size.height;
  }
  size.width = std::max(size.width, part.left_px + part.geometry.width);
  size.height = std::max(size.height, part.top_px + part.geometry.height);
}

/// Reads the wall of `flags` with its rigs, and sets source and display of the plan. Throws
/// Error(Usage) for flags that need one rig, Error(Input) for files that are not valid.
void plan_wall(const PlayFlags& flags, PlayPlan& plan) {
  refuse_flags_of_one_rig(flags, plan);
  const optics::PlacedWall wall = optics::load_wall(flags.wall);
  frames::FrameGeometry& size = plan.context.panel;
  display::ScanoutPart last;
  for (const optics::PlacedPanel& panel : wall.panels) {
    require_equal_bits(wall.panels.front(), panel);
    const optics::Rig& rig = panel.trimmed.rig;
    const frames::FrameGeometry seen{.width = rig.panel.width_px, .height = rig.panel.height_px};
    display::OutputPart output{
        .name = panel.name, .connector = panel.output, .identity = rig.identity};
    output.place.mounting = rig.panel.mounting;
    output.place.geometry = display::turned(seen, rig.panel.mounting);
    place_beside(last, output.place, size);
    last = output.place;
    plan.display.parts.push_back(std::move(output));
    plan.context.wall.push_back({.name = panel.name,
                                 .panel = seen,
                                 .identity = panel.trimmed.identity,
                                 .rig = rig,
                                 .card = rig_card(rig, panel.name)});
  }
  plan.context.rig_name = flags.wall;
  plan.display.panel = size;
  plan.display.depth = display::depth_of(wall.panels.front().trimmed.rig.panel.bits);
}

using display::Nanoseconds;

constexpr auto kLongestPriming = std::chrono::hours(24);  // used with --wait forever
/// Long enough to plug a loose cable back in.
constexpr Nanoseconds kPanelAfterLoss = std::chrono::seconds(10);

constexpr std::string_view kWindow = "window";

/// Returns true for "window" and "window:...": a virtual display of the same form with a window.
bool is_window_spec(std::string_view spec) { return spec.substr(0, spec.find(':')) == kWindow; }

/// Returns the loops. Test cards, black frames and numbered views loop forever by default.
uint64_t parse_loops(const PlayFlags& flags, SourceKind kind) {
  const bool is_looked_at = kind == SourceKind::Card || kind == SourceKind::Black ||
                            kind == SourceKind::RigViews || kind == SourceKind::Code;
  const bool until_closed = flags.duration_s || is_window_spec(flags.display);
  if (flags.loop.empty()) return until_closed || is_looked_at ? kForever : 1;
  if (flags.loop == "forever") return kForever;
  if (const auto loops = number_from<uint64_t>(flags.loop); loops && *loops > 0) return *loops;
  refuse_flag(fmt::format("--loop '{}': not a number of loops", flags.loop),
              "write a number of 1 or more, or forever");
}

/// Parses the value of --fps.
frames::Rate content_rate(const std::string& text) {
  try {
    return frames::parse_rate(text);
  } catch (const Error& error) {
    throw Error(error.kind(), std::string("--fps: ") + error.what(), error.hint());
  }
}

/// Parses a timeout; none = forever.
std::optional<std::chrono::nanoseconds> parse_wait(const char* flag, const std::string& text,
                                                   uint32_t least) {
  if (text == "forever") return std::nullopt;
  const auto seconds = number_from<uint32_t>(text);
  if (seconds && *seconds >= least) return std::chrono::seconds(*seconds);
  refuse_flag(fmt::format("{} '{}': not a number of seconds", flag, text),
              fmt::format("write a number of {} or more, or forever", least));
}

display::ExitPolicy exit_policy(const std::string& on_exit, bool service) {
  if (on_exit == "black") return display::ExitPolicy::Black;
  if (on_exit == "hold" || (on_exit.empty() && service)) return display::ExitPolicy::Hold;
  return display::ExitPolicy::Restore;
}

/// Returns the virtual display that a window shows.
std::string virtual_display_of_window(const PlayFlags& flags) {
  if (!flags.record.empty())
    refuse_flag("--record: a window is not recorded", "use --display virtual");
  if (flags.clock != "real")
    refuse_flag("--clock: a window shows frames in real time", "use --display virtual");
  return "virtual" + flags.display.substr(kWindow.size());
}

/// Returns the options of a KMS display other than its name.
display::KmsOptions kms_options(const PlayFlags& flags, bool service) {
  if (!flags.record.empty())
    refuse_flag("--record: a graphics card does not report what it displayed",
                "use --display virtual");
  if (flags.clock != "real")
    refuse_flag("--clock: cannot be set for a panel, which has its own clock",
                "use --display virtual");
  display::KmsOptions options;
  options.exit = exit_policy(flags.on_exit, service);
  options.allow_inexact = flags.allow_inexact;
  return options;
}

/// Returns the slots of one source. Three sources may be open at once: the playing one, the next
/// one, and the one whose last frame is still displayed.
int slots_of(const PlayFlags& flags, frames::FrameGeometry panel) {
  if (!flags.memory_mib) return flags.slots;
  const auto bytes = static_cast<uint64_t>(*flags.memory_mib) << 20;
  const uint64_t slots = bytes / 3 / panel.frame_bytes();
  if (slots >= 2) return static_cast<int>(std::min<uint64_t>(slots, 4096));
  refuse_flag(
      fmt::format("--memory {}: less than two frames for each of three sources", *flags.memory_mib),
      fmt::format("use at least {} for this panel", (panel.frame_bytes() * 6 >> 20) + 1));
}

void plan_control(const PlayFlags& flags, PlayPlan& plan) {
  if (!flags.control_group.empty() && flags.control.empty())
    refuse_flag("--control-group: has no effect without a control socket", "add --control");
  if (!flags.control.empty() && flags.clock == "simulated")
    refuse_flag("--control: cannot be combined with --clock simulated",
                "leave out --clock simulated");
  if (!flags.control_group.empty()) plan.control_group = group_named(flags.control_group);
}

/// The proof of play is on for a service, and off on a developer's machine, where it would fill the
/// journal with tests.
void plan_proof(const PlayFlags& flags, bool service, PlayPlan& plan) {
  plan.proof = flags.proof.empty() ? service : flags.proof == "journal";
  if (!plan.proof || flags.clock != "simulated") return;
  if (!flags.proof.empty())
    refuse_flag("--proof journal: cannot be combined with --clock simulated",
                "leave out --clock simulated");
  plan.proof = false;
}

void check_step_flags(const PlayFlags& flags, SourceKind kind) {
  if (flags.leader == flags.follow)
    refuse_flag("--step: needs either --leader or --follow",
                "use --leader for one player of the group and --follow for the others");
  if (flags.step_address.empty())
    refuse_flag("--step-address: missing", "give all players of the group the leader's address");
  const bool named =
      flags.step.size() <= kStepNameBytes && flags.step.find_first_not_of(
                                                 "abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRST"
                                                 "UVWXYZ0123456789._-") == std::string::npos;
  if (!named)
    refuse_flag(fmt::format("--step '{}': not the name of a group", flags.step),
                fmt::format("use at most {} letters, digits, '.', '_' and '-'", kStepNameBytes));
  const bool is_list = kind == SourceKind::List;
  if (is_list || kind == SourceKind::Ring || kind == SourceKind::Live)
    refuse_flag(fmt::format("--step: {} is a {}, whose frames have no common numbers", flags.source,
                            is_list                    ? "list"
                            : kind == SourceKind::Ring ? "ring"
                                                       : "camera"),
                "play one film or one pattern of pictures on all players");
  if (flags.clock == "simulated")
    refuse_flag("--step: cannot be combined with --clock simulated", "leave out --clock simulated");
  if (flags.late == "hold")
    refuse_flag("--late hold: cannot be combined with --step, which leaves out late frames",
                "leave out --late");
}

void plan_step(const PlayFlags& flags, PlayPlan& plan) {
  if (flags.step.empty()) {
    if (flags.leader || flags.follow || !flags.step_address.empty() || !flags.step_key.empty())
      refuse_flag("--leader, --follow, --step-address and --step-key: no effect without a group",
                  "add --step GROUP");
    return;
  }
  check_step_flags(flags, plan.source.kind);
  StepOptions& step = plan.step.emplace();
  step.group = flags.step;
  step.leader = flags.leader;
  step.address = parse_step_address(flags.step_address);
  if (!flags.step_key.empty())
    step.key = read_step_key(flags.step_key);
  else if (!step.address.is_unix)
    refuse_flag("--step-key: missing; messages over a network need a key",
                "head -c 32 /dev/urandom > step.key; chmod 600 step.key; copy it to each machine");
  plan.playback.late = LatePolicy::Drop;
}

void plan_sound(const PlayFlags& flags, PlayPlan& plan) {
  SoundOptions options{.track = flags.sound_track,
                       .volume_db = flags.volume_db,
                       .simulated = flags.clock == "simulated"};
  const bool seen = display::is_kms_spec(flags.display) || plan.window;
  options.device = !flags.sound_device.empty() ? flags.sound_device : seen ? "auto" : "none";
  if (options.simulated && options.device != "none" && !options.device.starts_with("file:"))
    refuse_flag("--sound-device: a device plays in real time",
                "use --sound-device file:OUT.wav with --clock simulated");
  options.delay = std::chrono::microseconds(std::llround(flags.sound_delay_ms.value_or(0.0) * 1e3));
  if (!flags.sound.empty() && flags.sound != "none" && !mark_of(flags.sound).there)
    throw input_error("--sound {}: no such file", flags.sound)
        .remedy("name a file with sound, or none");
  const bool silent_list = plan.source.kind == SourceKind::List && !flags.sound.empty();
  if (silent_list && flags.sound != "none")
    refuse_flag("--sound: items of a list have their own sound",
                "write sound = \"FILE\" to the item, or use --sound none");
  if (flags.preflight || silent_list) options.device = "none";
  plan.sound = std::make_shared<SoundPlayer>(std::move(options));
}

/// Checks the flags that state how views are laid out in a single source; items of a list state
/// that in keys, names or sidecars.
void plan_content(const PlayFlags& flags, PlayPlan& plan) {
  const SourceSpec& source = plan.source;
  ContentFlags layout = source.content;
  if (names_folder(source.text)) layout.reweave = false;  // for all of its files
  if (layout != ContentFlags{} && !source.takes_layout())
    refuse_flag(fmt::format("{}: flags for the layout of views need a single file", source.text),
                "items of a list have keys for it: grid = \"8x6\", stereo = \"sbs\" "
                "(docs/play/control.md)");
  (void)weave_options(flags.weaving);  // called early for its errors
  plan.context.weaving = flags.weaving;
}

/// Reads the rig, which the player follows from then on.
void plan_rig(const PlayFlags& flags, PlayPlan& plan) {
  const SourceKind kind = plan.source.kind;
  const bool may_show_views =
      kind == SourceKind::RigViews || kind == SourceKind::List || !flags.control.empty();
  plan.context.rig = std::make_shared<LiveRig>(
      plan.rig_file,
      flags.rig_of_film ? "the film contains the rig in use; play it with --rig RIG.toml" : "");
  if (flags.trim || may_show_views) plan.trim = plan.context.rig;
  const optics::Rig rig = plan.context.rig->rig();
  plan.context.panel = {.width = rig.panel.width_px, .height = rig.panel.height_px};
  plan.context.rig_name = rig.name;
  plan.context.card = rig_card(rig, plan.rig_file);
  plan.display.panel = plan.context.panel;
  plan.display.mounting = rig.panel.mounting;
  plan.display.depth = display::depth_of(rig.panel.bits);
  plan.display.kms.output.identity = rig.identity;
}

/// Returns the file of the rig in use: --rig, or its copy that this player may change. A copy that
/// cannot be written is no reason to show nothing.
std::string rig_file_of(const PlayFlags& flags, PlayPlan& plan) {
  if (flags.rig_store.empty()) return flags.rig;
  optics::RigStore& store = plan.rig_store.emplace(flags.rig, flags.rig_store);
  try {
    (void)store.update();
  } catch (const Error& error) {
    if (error.kind() == ErrorKind::Input) throw;
    say("{}; the rig cannot be changed during playback\n", error.what());
  }
  if (store.differs())
    say("{}: was calibrated or trimmed during playback; used until {} is edited\n", flags.rig_store,
        flags.rig);
  return store.in_use().string();
}

}  // namespace

void check_display_choice(const PlayFlags& flags, bool service) {
  if (flags.display_named) return;
  const auto refuse_panel_flag = [](const std::string& what) {
    refuse_flag(what, "add --display kms, or --display virtual if no panel is needed");
  };
  if (service) refuse_panel_flag("--display: missing; a service needs it");
  if (!flags.wait_for_panel.empty())
    refuse_panel_flag("--wait-for-panel: has no effect without --display");
  if (!flags.on_exit.empty()) refuse_panel_flag("--on-exit: has no effect without --display");
  say("no --display: playing on the virtual display, which shows nothing (--display kms is a "
      "panel)\n");
}

std::optional<Nanoseconds> panel_wait_at_start(const PlayFlags& flags, bool service) {
  if (!flags.wait_for_panel.empty()) return parse_wait("--wait-for-panel", flags.wait_for_panel, 0);
  return service ? std::nullopt : std::optional(Nanoseconds{0});
}

PlayPlan make_plan(const PlayFlags& flags, bool service) {
  PlayPlan plan;
  plan.source = parse_source(flags.source, flags.content);
  const SourceKind kind = plan.source.kind;
  plan.playback.loops = parse_loops(flags, kind);
  plan.playback.late = parse_late_policy(flags.late);
  const auto wait = parse_wait("--wait", flags.wait.empty() ? "60" : flags.wait, 1);
  plan.outlasts_faults =
      plan.playback.loops != 1 || !flags.control.empty() || kind == SourceKind::Live;
  const bool gives_up = !flags.wait.empty() || kind == SourceKind::Ring ||
                        !(plan.outlasts_faults || kind == SourceKind::List);
  plan.playback.stall_timeout = gives_up ? wait : std::nullopt;
  plan.playback.prime = flags.prime.value_or(std::max(1, flags.slots / 2));
  if (flags.prime)  // a user who sets --prime wants to wait until that many frames are ready
    plan.playback.prime_timeout = wait.value_or(kLongestPriming);
  plan.playback.started = flags.started;
  plan.playback.source_name = flags.source;
  plan.playback.stop_fd = interrupt_fd();
  if (!flags.fps.empty()) plan.playback.content = content_rate(flags.fps);
  if (flags.clock == "simulated") {
    plan.display.clock = std::make_shared<display::SimulatedClock>();
    plan.playback.filling = Filling::InPresenter;
  } else {
    plan.playback.real_time_priority = true;
  }
  // Neither an examination nor simulated time goes on until the files are old enough to be whole.
  if (flags.preflight || flags.clock == "simulated")
    plan.folders = std::make_shared<FolderLists>(2 * FolderWatch::kQuiet);
  plan.window = is_window_spec(flags.display);
  plan.display.spec = plan.window ? virtual_display_of_window(flags) : flags.display;
  plan.display.buffers = flags.buffers;
  display::check_display_spec(plan.display.spec);
  if (flags.wall.empty()) plan.rig_file = rig_file_of(flags, plan);
  plan_content(flags, plan);
  plan.context.slots = flags.slots;
  plan.context.plays_again = plan.playback.loops != 1 || plan.source.may_be_still();
  plan.context.video_hardware = flags.video_decoder != "software";
  plan.duration_s = flags.duration_s;
  plan.panel_at_start = panel_wait_at_start(flags, service);
  const bool default_loss = flags.wait_for_panel.empty() && !service;
  plan.panel_after_loss = default_loss ? kPanelAfterLoss : plan.panel_at_start;
  if (!flags.frames.empty()) plan.context.frames = parse_frame_range(flags.frames);

  plan_control(flags, plan);
  plan_proof(flags, service, plan);
  plan_step(flags, plan);
  plan_sound(flags, plan);
  plan.context.warnings = std::make_shared<RigWarnings>();
  if (display::is_kms_spec(flags.display)) plan.display.kms = kms_options(flags, service);
  if (flags.wall.empty())
    plan_rig(flags, plan);
  else
    plan_wall(flags, plan);
  plan.context.slots = slots_of(flags, plan.context.panel);
  return plan;
}

uint64_t whole_vblanks(std::chrono::duration<double> duration, frames::Rate refresh) {
  return static_cast<uint64_t>(std::max(1.0, duration.count() * refresh.hertz()));
}

std::optional<uint64_t> vblanks_of(std::optional<double> duration_s, frames::Rate refresh) {
  constexpr double kMaxDurationS = 1e9;
  if (!duration_s) return std::nullopt;
  if (!(*duration_s <= kMaxDurationS))
    refuse_flag(fmt::format("--duration {}: too long", *duration_s), "use --loop forever");
  return whole_vblanks(std::chrono::duration<double>(*duration_s), refresh);
}

Playlist read_playlist(const SourceSpec& source, const PlayFlags& flags, const PlayPlan& plan) {
  if (source.kind != SourceKind::List) {
    Playlist list = playlist_of(source, plan.playback.loops);
    PlaylistItem& item = list.items.front();
    if (source == plan.source) item.frames = plan.context.frames;
    if (source == plan.source) item.sound = flags.sound;
    // In simulated time a picture that stays would never end: there is no moment for Ctrl-C.
    const bool stays = flags.loop.empty() && flags.clock != "simulated";
    if (item.loops != kForever && source.has_pictures())
      item.still_s = stays ? kUntilEnded : kStillSeconds * static_cast<double>(item.loops);
    return list;
  }
  const bool is_folder = names_folder(source.text);
  const std::string file = is_folder ? list_in_folder(source.text) : source.text;
  if (is_folder && !file.empty())
    say("{}: played instead of all files of its folder; rename it to play all\n", file);
  Playlist list = file.empty() ? plan.folders->read(source.text)
                               : plan.folders->with_files(load_playlist(file));
  if (names_folder(plan.source.text) && list.name.starts_with(plan.source.text))
    for (PlaylistItem& item : list.items) item.source.content.reweave = flags.content.reweave;
  const bool says_how_often = !flags.loop.empty() || flags.duration_s;
  if (says_how_often) list.rounds = plan.playback.loops;
  return list;
}

ItemOpener item_opener(const PlayPlan& plan) {
  return [name = plan.source.text, like = plan.context, sound = plan.sound,
          rate = plan.playback.content](const PlaylistItem& item, uint64_t first_frame) {
    OpenContext context = like;
    context.frames = item.frames;
    if (!item.fit.empty()) context.weaving.fit = item.fit;
    if (!item.shown.plays()) {
      context.card = error_card(name, Error(ErrorKind::Input, item.shown.reason), item.shown.word);
      for (WallPart& part : context.wall) part.card = context.card;
    }
    context.first_frame = first_frame;
    context.plays_again =
        item.loops != 1 || item.duration_s.has_value() || item.source.may_be_still();
    OpenedSource opened = open_source(item.source, context);
    if (sound) opened.begin_sound = sound->open(item, rate, first_frame, *opened.source);
    return opened;
  };
}

std::optional<PlayPlan> plan_when_rig_is_right(const PlayFlags& flags,
                                               const ServiceManager& manager,
                                               const display::KmsOptions& services) {
  constexpr Nanoseconds kTryAgain = std::chrono::seconds(5);
  display::KmsOptions any_panel = services;
  std::optional<PanelCard> card;
  while (!interrupted()) {
    try {
      return make_plan(flags, manager.present());
    } catch (const Error& error) {
      if (error.kind() == ErrorKind::Usage || !display::is_kms_spec(flags.display)) throw;
      if (!card) {
        any_panel.output = display::parse_kms_spec(flags.display, any_panel.output);
        any_panel.output.policy = display::IdentityPolicy::Ignore;
        any_panel.exit = display::ExitPolicy::Black;
        if (!any_panel.clock) any_panel.clock = display::make_monotonic_clock();
        if (!any_panel.session) any_panel.session = display::make_direct_session();
        card.emplace(any_panel);
      }
      manager.status(std::string("test card shown: ") + error.what());
      const display::PanelSearch search = search_panel(any_panel, card->display());
      const display::CardText text = error_card(flags.rig_or_wall(), error);
      if (search.present.empty() || !card->show(search.present.front(), text)) card->close();
    }
    (void)card->wait(any_panel.clock->now() + kTryAgain, interrupt_fd());
  }
  return std::nullopt;
}

}  // namespace lenticule::player
