// SPDX-License-Identifier: Apache-2.0
#include <array>

#include "apps/lenticule/cli/command.h"

namespace lenticule::cli {

// Each function is defined in the file of its command.
Run declare_play(CLI::App& app);
Run declare_ctl(CLI::App& app);
Run declare_report(CLI::App& app);
Run declare_panels(CLI::App& app);
Run declare_doctor(CLI::App& app);
Run declare_bench(CLI::App& app);
Run declare_web(CLI::App& app);

namespace {

constexpr auto kCommands = std::to_array<Command>({
    {"render", "render a scene to woven frames, into files or a player's ring",
     "lenticule render builtin:demo -o woven.png"},
    {"play", "play woven frames on a display at its own clock",
     "lenticule play film.lts --display kms --loop forever"},
    {"ctl", "control a running player: pause, seek, load, trim, watch",
     "lenticule ctl --socket /run/lenticule/lobby/control.sock status"},
    {"report", "report how often each film was played, from the journal",
     "lenticule report --since 2026-11-01 --unit lenticule-player@lobby"},
    {"weave", "weave a quilt or a set of views into one woven frame",
     "lenticule weave views_qs8x6a0.75.png -o woven.png"},
    {"eye", "show what an eye at one place sees of a woven frame",
     "lenticule eye woven.png --eye -32,0,700 -o left.png"},
    {"compare", "measure how much pictures differ",
     "lenticule compare reference.png test.png --rig kiosk-27-4k.toml --json"},
    {"convert", "convert frames and views between pictures, sequence containers and videos",
     "lenticule convert 'out/%05d.png' --rig kiosk-27-4k.toml --rate 24 -o film.lts"},
    {"calibrate", "find the lens sheet's pitch, slant, offset and gap",
     "lenticule calibrate by-eye --display kms -o lobby.toml"},
    {"depth", "measure how deep a scene is for a panel, and how much of it is shown sharply",
     "lenticule depth builtin:demo --depth-budget 4 --picture depth.png"},
    {"farm", "render a film on many machines, with Slurm or any other scheduler",
     "lenticule farm plan model.glb --frames 0:750 -o film.lts --work /shared/film"},
    {"rig", "show, check, import, export and turn rig files",
     "lenticule rig import visual.json -o portrait.toml"},
    {"panels", "list connected panels, their identity, modes and matching rigs",
     "lenticule panels"},
    {"web", "serve pages on which a phone controls and watches a player",
     "lenticule web --socket /run/lenticule/lobby/control.sock --media /var/lib/lenticule/media"},
    {"doctor", "check whether outputs show frames exactly, and what prevents it",
     "lenticule doctor --json"},
    {"scene", "show what a scene file holds, or write one of the built-in scenes",
     "lenticule scene show model.glb -o thumbnail.png"},
    {"bench", "run a benchmark of this build on this machine", "lenticule bench exact"},
    {"completion", "print a shell completion script",
     "lenticule completion bash > /etc/bash_completion.d/lenticule"},
    {"man", "print the manual page", "lenticule man | man -l -"},
});

constexpr auto kPlayerCommands = std::to_array<Declaration>({
    {"play", declare_play},
    {"ctl", declare_ctl},
    {"report", declare_report},
    {"panels", declare_panels},
    {"doctor", declare_doctor},
    {"bench", declare_bench},
    {"web", declare_web},
});

}  // namespace

std::span<const Command> commands() { return kCommands; }

std::span<const Declaration> player_commands() { return kPlayerCommands; }

}  // namespace lenticule::cli
