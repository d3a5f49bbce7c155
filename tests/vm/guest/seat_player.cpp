// SPDX-License-Identifier: Apache-2.0
// Runs in the guest: plays a source on the rig's panel in a loop through a seat (libseat) until
// interrupted. Prints "shown N pauses N modesets N took_over 0|1" once a second.
//   vm_seat_player SOURCE RIG
#include <cstdio>
#include <exception>
#include <memory>

#include "display/kms/scanout/kms_display.h"
#include "optics/rig_file.h"
#include "player/playback/playback.h"
#include "player/process/interrupt.h"
#include "player/sources/open_source.h"

namespace lenticule::vm {
namespace {

void report(const player::PlayReport& now, const display::KmsDisplay& display) {
  const display::KmsStatistics kms = display.statistics();
  std::printf("shown %llu pauses %llu modesets %llu took_over %d\n",
              static_cast<unsigned long long>(now.pace.shown),
              static_cast<unsigned long long>(kms.times_paused),
              static_cast<unsigned long long>(kms.modesets), display.took_over() ? 1 : 0);
  std::fflush(stdout);
}

int play(const char* source, const char* rig_file) {
  const optics::Rig rig = optics::load_rig(rig_file);
  const frames::FrameGeometry panel{.width = rig.panel.width_px, .height = rig.panel.height_px};
  display::KmsOptions options;
  options.output.panel = panel;
  options.session = display::make_seat_session();
  const std::unique_ptr<display::KmsDisplay> display = display::open_kms_display(options);
  std::printf("opened %s\n", display->mode().name.c_str());

  player::OpenContext context;
  context.panel = panel;
  context.identity = optics::identity_of(rig, {});
  context.plays_again = true;
  const player::OpenedSource opened = player::open_source(player::parse_source(source), context);
  player::PlaybackOptions playback;
  playback.loops = player::kForever;
  playback.stop_fd = player::interrupt_fd();
  playback.on_report = [&](const player::PlayReport& now) { report(now, *display); };
  const player::PlayResult result = player::play(*display, *opened.source, playback);
  std::printf("ended %s\n", player::outcome_name(result.outcome));
  return result.outcome == player::PlayOutcome::Stopped ? 0 : 1;
}

}  // namespace
}  // namespace lenticule::vm

int main(int argc, char** argv) {
  if (argc != 3) {
    std::fprintf(stderr, "vm_seat_player SOURCE RIG\n");
    return 2;
  }
  lenticule::player::install_interrupt_handlers();
  try {
    return lenticule::vm::play(argv[1], argv[2]);
  } catch (const std::exception& error) {
    std::fprintf(stderr, "vm_seat_player: %s\n", error.what());
    return 1;
  }
}
