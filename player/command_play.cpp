// SPDX-License-Identifier: Apache-2.0
// lenticule play

#include <CLI/CLI.hpp>
#include <memory>
#include <optional>
#include <utility>

#include "base/error.h"
#include "base/print.h"
#include "frames/picture_codec.h"
#include "player/command.h"
#include "player/confined_pictures.h"
#include "player/interrupt.h"
#include "player/play_plan.h"
#include "player/play_run.h"
#include "player/preflight.h"
#include "player/rig_trouble.h"
#include "player/service_manager.h"
#include "player/start_history.h"

namespace lenticule::player {
namespace {

/// So many failed starts in short order are no accident.
constexpr int kFailuresUntilSafe = 5;
/// And so many, with care, that the source itself is suspected.
constexpr int kFailuresUntilCard = 10;

SafeStart safe_start(const PlayFlags& flags, const StartHistory& history) {
  const int failures = history.failures();
  return {.on = flags.safe || failures >= kFailuresUntilSafe,
          .card_first = failures >= kFailuresUntilCard,
          .failures = failures,
          .last_reason = history.last_reason()};
}

ExitCode play_with(const PlayFlags& flags, const ServiceManager& manager, const SafeStart& safe) {
  if (safe.failures >= kFailuresUntilSafe)
    say("{} starts failed within two minutes: starting with care\n", safe.failures);
  if (!safe.on) return PlayRun(flags, make_plan(flags, manager.present()), manager, safe).run();
  std::optional<PlayPlan> plan = plan_when_rig_is_right(flags, manager);
  if (!plan) return interrupt_exit_code();
  return PlayRun(flags, std::move(*plan), manager, safe).run();
}

ExitCode run_play(const PlayFlags& flags) {
  if (flags.preflight) return run_preflight(flags, make_plan(flags, false));
  const ServiceManager manager;
  check_display_choice(flags, manager.present());
  const bool may_reload = manager.present() || !flags.control.empty();
  if (may_reload && !has_terminal()) reload_at_hangup();
  StartHistory history(runtime_folder(), time_since_boot());
  try {
    const ExitCode code = play_with(flags, manager, safe_start(flags, history));
    history.ended_well();
    return code;
  } catch (const Error& error) {
    history.failed(error.what());
    throw;
  }
}

}  // namespace

namespace {

/// While it lives, pictures are decoded in confined processes: a player shows other people's files
/// for days. Commands that are run by hand decode their own.
class PicturesDecodedElsewhere {
 public:
  PicturesDecodedElsewhere() { frames::use_picture_reader(&pictures_); }
  ~PicturesDecodedElsewhere() { frames::use_picture_reader(nullptr); }
  PicturesDecodedElsewhere(const PicturesDecodedElsewhere&) = delete;
  PicturesDecodedElsewhere& operator=(const PicturesDecodedElsewhere&) = delete;

 private:
  ConfinedPictures pictures_;
};

}  // namespace

Run declare_play(CLI::App& app) {
  const auto flags = std::make_shared<PlayFlags>();
  declare_flags(app, *flags);
  return [flags] {
    const PicturesDecodedElsewhere confined;
    return run_play(*flags);
  };
}

}  // namespace lenticule::player
