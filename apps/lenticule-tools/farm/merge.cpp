// SPDX-License-Identifier: Apache-2.0
// lenticule farm merge joins the chunks of a plan into the film.
#include <fmt/format.h>

#include "apps/lenticule-tools/farm/actions.h"
#include "apps/lenticule-tools/offline/existing_output.h"
#include "base/error.h"
#include "base/json_output.h"
#include "base/print.h"
#include "farm/work_folder.h"
#include "player/process/interrupt.h"
#include "player/process/progress.h"

namespace lenticule::tools {

ExitCode farm_merge(const FarmMergeFlags& flags) {
  const farm::WorkFolder folder(flags.folder);
  const farm::Plan& plan = folder.plan();
  const std::string film = flags.output.empty() ? plan.output : flags.output;
  OutputRequest request{.target = film, .range = {plan.begin, plan.end}};
  request.geometry = plan.film.geometry;
  request.rig = frames::rig_of(plan.film);
  request.sequence = plan.film;
  request.overwrite = flags.overwrite;
  require_replaceable_film(request);
  player::Progress progress("merge", "chunks", plan.chunks());
  farm::MergeOptions options{.partial = flags.partial,
                             .wait = std::chrono::seconds(flags.wait_seconds)};
  options.stops = [&](uint64_t chunk) {
    progress.update(chunk);
    return player::interrupted();
  };
  const farm::MergeResult result = farm::merge_film(folder, film, options);
  if (result.stopped) return player::interrupt_exit_code();
  progress.update(result.chunks);
  progress.finish();
  const nlohmann::json out = {{"output", film},
                              {"frames", result.frames},
                              {"chunks", result.chunks},
                              {"bytes", result.bytes},
                              {"complete", result.chunks == plan.chunks()}};
  if (flags.json) {
    print_json(out);
  } else {
    print_out("{}: {} of {} frames, {} MiB\n", film, result.frames, plan.end - plan.begin,
              result.bytes >> 20U);
  }
  return kOk;
}

}  // namespace lenticule::tools
