// SPDX-License-Identifier: Apache-2.0
// lenticule-tools has every command. lenticule starts it for those that need more than a player. It
// has the others, too, because the manual and the completion scripts list the flags of all.
#include <array>
#include <cstdlib>
#include <vector>

#include "apps/lenticule-tools/offline/confined_scenes.h"
#include "apps/lenticule/cli/program.h"

namespace lenticule::tools {

using cli::Run;

// Each function is defined in the file of its command.
Run declare_render(CLI::App& app);
Run declare_weave(CLI::App& app);
Run declare_eye(CLI::App& app);
Run declare_compare(CLI::App& app);
Run declare_convert(CLI::App& app);
Run declare_calibrate(CLI::App& app);
Run declare_depth(CLI::App& app);
Run declare_farm(CLI::App& app);
Run declare_rig(CLI::App& app);
Run declare_scene(CLI::App& app);
Run declare_completion(CLI::App& app);
Run declare_man(CLI::App& app);

}  // namespace lenticule::tools

int main(int argc, char** argv) {
  using namespace lenticule::tools;
  constexpr auto kTools = std::to_array<lenticule::cli::Declaration>({
      {"render", declare_render},
      {"weave", declare_weave},
      {"eye", declare_eye},
      {"compare", declare_compare},
      {"convert", declare_convert},
      {"calibrate", declare_calibrate},
      {"depth", declare_depth},
      {"farm", declare_farm},
      {"rig", declare_rig},
      {"scene", declare_scene},
      {"completion", declare_completion},
      {"man", declare_man},
  });
#ifdef LENTICULE_VIDEO
  // The processes that read models and pictures fill large buffers. With huge pages for what their
  // malloc gets from the kernel, they have fewer page faults.
  ::setenv("GLIBC_TUNABLES", "glibc.malloc.hugetlb=1", 0);
  // This process has the rights of its user, so a process without rights reads models.
  const ConfinedScenes models;
  lenticule::render::use_scene_reader(&models);
#endif
  std::vector<lenticule::cli::Declaration> declared(kTools.begin(), kTools.end());
  declared.insert(declared.end(), lenticule::cli::player_commands().begin(),
                  lenticule::cli::player_commands().end());
  return lenticule::cli::run_program({.commands = lenticule::cli::commands(),
                                      .declared = declared,
                                      .first_steps = lenticule::cli::kFirstSteps},
                                     argc, argv);
}
