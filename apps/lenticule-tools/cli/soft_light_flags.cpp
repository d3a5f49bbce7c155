// SPDX-License-Identifier: Apache-2.0
#include "apps/lenticule-tools/cli/soft_light_flags.h"

#include <CLI/CLI.hpp>

namespace lenticule::player {

void declare_soft_light_flags(CLI::App& app, render::SoftLight& soft) {
  constexpr const char* kGroup = "Soft light (rays for each shaded point)";
  CLI::Option* shadows =
      app.add_option("--soft-shadows", soft.shadow_samples, "rays to each lamp that has a size")
          ->group(kGroup);
  app.add_option("--light-size", soft.lamp_radius_mm,
                 "radius of lamps that stand somewhere, mm on the glass; 0 = hard")
      ->group(kGroup)
      ->needs(shadows)
      ->capture_default_str();
  app.add_option("--sun-size", soft.sun_radius_degrees,
                 "radius of lamps infinitely far away, degrees; 0 = hard")
      ->group(kGroup)
      ->needs(shadows)
      ->capture_default_str();
  CLI::Option* occlusion =
      app.add_option("--occlusion", soft.occlusion_samples,
                     "rays that find out how much of the ambient light is blocked")
          ->group(kGroup);
  app.add_option("--occlusion-distance", soft.occlusion_distance_mm,
                 "how far they look, mm on the glass; inf = everywhere")
      ->group(kGroup)
      ->needs(occlusion)
      ->capture_default_str();
  app.add_option("--environment-light", soft.environment_samples,
                 "rays to the surroundings, which then light the scene instead of ambient light")
      ->group(kGroup)
      ->excludes(occlusion);
}

}  // namespace lenticule::player
