// SPDX-License-Identifier: Apache-2.0
#include "apps/lenticule-tools/cli/soft_light_flags.h"

#include <CLI/CLI.hpp>

namespace lenticule::tools {

void declare_soft_light_flags(CLI::App& app, render::SoftLight& soft) {
  app.option_defaults()->group("Soft light (rays for each shaded point)");
  CLI::Option* shadows =
      app.add_option("--soft-shadows", soft.shadow_samples, "rays to each area light");
  app.add_option("--light-size", soft.light_radius_mm,
                 "radius of lights with a position, in the panel plane; 0: hard shadows")
      ->type_name("MM")
      ->needs(shadows)
      ->capture_default_str();
  app.add_option("--sun-size", soft.sun_radius_degrees,
                 "radius of lights at infinity; 0: hard shadows")
      ->type_name("DEGREES")
      ->needs(shadows)
      ->capture_default_str();
  CLI::Option* occlusion =
      app.add_option("--occlusion", soft.occlusion_samples,
                     "rays that measure how much of the ambient light is occluded");
  app.add_option("--occlusion-distance", soft.occlusion_distance_mm,
                 "largest distance of occluders, in the panel plane; inf: unlimited")
      ->type_name("MM")
      ->needs(occlusion)
      ->capture_default_str();
  app.add_option("--environment-light", soft.environment_samples,
                 "rays to the environment, which then lights the scene\n"
                 "Instead of the ambient light.")
      ->excludes(occlusion);
  app.option_defaults()->group("Options");
}

}  // namespace lenticule::tools
