// SPDX-License-Identifier: Apache-2.0

#include <CLI/CLI.hpp>
#include <cmath>

#include "apps/lenticule/cli/command.h"
#include "base/print.h"

namespace lenticule::player {

// Each function is defined in the file of its command.
Run declare_render(CLI::App& app);
Run declare_play(CLI::App& app);
Run declare_ctl(CLI::App& app);
Run declare_weave(CLI::App& app);
Run declare_eye(CLI::App& app);
Run declare_compare(CLI::App& app);
Run declare_convert(CLI::App& app);
Run declare_calibrate(CLI::App& app);
Run declare_rig(CLI::App& app);
Run declare_panels(CLI::App& app);
Run declare_depth(CLI::App& app);
Run declare_doctor(CLI::App& app);
Run declare_scene(CLI::App& app);
Run declare_bench(CLI::App& app);
Run declare_completion(CLI::App& app);
Run declare_man(CLI::App& app);

const std::vector<Command>& commands() {
  static const std::vector<Command> table = {
      {"render", "render a scene to woven frames, into files or a player's ring",
       "lenticule render teapot.nff --rig kiosk-27-4k.toml --frames 0:24 -o 'out/%05d.png'",
       declare_render},
      {"play", "play woven frames on a display at its own clock",
       "lenticule play 'out/%05d.png' --rig kiosk-27-4k.toml --display virtual --loop forever",
       declare_play},
      {"ctl", "steer a player that runs: pause, seek, load, trim, look at it",
       "lenticule ctl --socket /run/lenticule/lobby/control.sock status", declare_ctl},
      {"weave", "weave a quilt or a set of views into one woven frame",
       "lenticule weave views_qs8x6a0.75.png --rig kiosk-27-4k.toml -o woven.png", declare_weave},
      {"eye", "show what an eye at one place sees on a woven frame",
       "lenticule eye woven.png --rig kiosk-27-4k.toml --eye -32,0,700 -o left.png", declare_eye},
      {"compare", "measure how far one picture is from another",
       "lenticule compare reference.png test.png --rig kiosk-27-4k.toml --json", declare_compare},
      {"convert", "put woven frames into a sequence container, or take them out",
       "lenticule convert 'out/%05d.png' --rig kiosk-27-4k.toml --rate 24 -o film.lts",
       declare_convert},
      {"calibrate", "find the lens sheet's pitch, slant, offset and gap",
       "lenticule calibrate show fringes --rig kiosk-27-4k.toml --display kms", declare_calibrate},
      {"depth", "tell how deep a scene is for a panel, and how much of it is shown sharply",
       "lenticule depth teapot.nff --rig kiosk-27-4k.toml --depth-budget 4 --svg depth.svg",
       declare_depth},
      {"rig", "show, check, import and export rig files",
       "lenticule rig import visual.json -o portrait.toml", declare_rig},
      {"panels", "list connected panels, their identity, modes and matching rigs",
       "lenticule panels --rigs scenes/rigs", declare_panels},
      {"doctor", "tell what would keep an output from showing frames exactly",
       "lenticule doctor --json", declare_doctor},
      {"scene", "write one of the built-in scenes", "lenticule scene teapot -o teapot.nff",
       declare_scene},
      {"bench", "run a benchmark of this build on this machine", "lenticule bench exact",
       declare_bench},
      {"completion", "print a shell completion script",
       "lenticule completion bash > /etc/bash_completion.d/lenticule", declare_completion},
      {"man", "print the manual page", "lenticule man | man -l -", declare_man},
  };
  return table;
}

}  // namespace lenticule::player
