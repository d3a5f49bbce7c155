// SPDX-License-Identifier: Apache-2.0
// lenticule calibrate simulate runs a whole calibration on a simulated panel and camera, for
// learning and testing.
#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <cmath>
#include <filesystem>
#include <memory>

#include "apps/lenticule-tools/calibrate/calibrate.h"
#include "apps/lenticule-tools/calibrate/calibrate_result.h"
#include "apps/lenticule-tools/calibrate/camera_preview.h"
#include "base/error.h"
#include "base/print.h"
#include "calib/simulation/trial.h"
#include "optics/rig_file.h"
#include "player/process/interrupt.h"
#include "player/process/progress.h"

namespace lenticule::tools {
namespace {

struct SimulateFlags {
  std::string rig;
  uint64_t seed = 1;
  bool random = false;
  int panel_width = 3840;
  int camera_width = 1920;
  int viewpoints = 3;
  double noise = 0.01;
  double deformation = 0.05;
  std::string pictures;
  ResultFlags result;
};

calib::Trial trial_of(const SimulateFlags& flags) {
  const int panel_height = flags.panel_width * 9 / 16, camera_height = flags.camera_width * 9 / 16;
  calib::Trial trial =
      flags.random
          ? calib::random_trial(flags.seed, flags.panel_width, panel_height, flags.camera_width,
                                camera_height)
          : calib::plain_trial(flags.panel_width, panel_height, flags.camera_width, camera_height);
  if (!flags.random) {
    trial.seed = flags.seed;
    trial.sheet.seed = flags.seed;
    trial.sheet.deformation_lenses = flags.deformation;
    trial.camera.read_noise = trial.camera.shot_noise = flags.noise / std::sqrt(2.0);
  }
  trial.viewpoints.resize(static_cast<size_t>(flags.viewpoints));
  return trial;
}

void print_ground_truth(const calib::Trial& trial, const calib::TrialResult& result) {
  print_out("\nground truth: pitch {:.6f} subpixels, slant {:.6f}, offset {:.4f}\n",
            trial.sheet.pitch_subpx, trial.sheet.slant, trial.sheet.offset_lenses);
  print_out(
      "error of the rig: pitch {:.1e} (relative), slant {:.1e} px/px, gap {:.1e} (relative), phase "
      "{:.4f} lens at worst for any eye of the viewing zone\n",
      result.errors.pitch, result.errors.slant, result.errors.gap, result.errors.worst_lenses);
}

ExitCode run_simulate(const SimulateFlags& flags) {
  calib::Trial trial = trial_of(flags);
  const int each = calib::pattern_count({});
  player::Progress progress("calibrating", "patterns",
                            static_cast<uint64_t>(each) * static_cast<uint64_t>(flags.viewpoints));
  trial.progress = [&](size_t viewpoint, int pattern) {
    progress.update(viewpoint * static_cast<uint64_t>(each) + static_cast<uint64_t>(pattern),
                    trial.viewpoints[viewpoint].name);
    return !player::interrupted();
  };
  if (!flags.pictures.empty()) {
    std::filesystem::create_directories(flags.pictures);
    trial.before_pattern = [&](calib::SimulatedBench& bench, size_t viewpoint, int pattern) {
      // The camera sees the previous pattern; before the first there is none.
      if (pattern > 0)
        write_preview(bench.camera(), fmt::format("{}/{}-{:03}.png", flags.pictures,
                                                  trial.viewpoints[viewpoint].name, pattern - 1));
    };
  }
  const calib::TrialResult result = calib::run_trial(trial);
  progress.finish();
  if (player::interrupted()) return player::interrupt_exit_code();
  if (!result.failure.empty()) throw Error(ErrorKind::Quality, result.failure);
  calib::RecordDetails details{.when = std::chrono::system_clock::now(),
                               .method = "simulated",
                               .camera = {},
                               .temperature_celsius = {}};
  details.camera.name = "simulated camera";
  details.camera.width = flags.camera_width;
  details.camera.pixel_format = "simulated";
  const ExitCode code = conclude_calibration(result.calibration, details, flags.result);
  if (!flags.result.json) print_ground_truth(trial, result);
  return code;
}

}  // namespace

CalibrateWay declare_calibrate_simulate(CLI::App& app) {
  const auto flags = std::make_shared<SimulateFlags>();
  CLI::App* way = app.add_subcommand(
      "simulate",
      "calibrate a simulated panel with a simulated camera, and compare with the ground truth");
  way->footer(
      "Example:\n  lenticule calibrate simulate --noise 0.03 --deformation 0.1 -o sim.toml");
  way->add_option("--seed", flags->seed, "seed of the simulated set-up")->capture_default_str();
  way->add_flag("--random", flags->random, "choose sheet, camera and starting rig at random");
  way->add_option("--panel-width", flags->panel_width,
                  "width of the panel; the height is 9/16 of it")
      ->type_name("PIXELS")
      ->check(CLI::Range(320, 15360))
      ->capture_default_str();
  way->add_option("--camera-width", flags->camera_width,
                  "width of the pictures; the height is 9/16 of it")
      ->type_name("PIXELS")
      ->check(CLI::Range(320, 7680))
      ->capture_default_str();
  way->add_option("--viewpoints", flags->viewpoints, "places of the camera")
      ->check(CLI::Range(1, 3))
      ->capture_default_str();
  way->add_option("--noise", flags->noise, "noise of the camera, as a fraction of full scale")
      ->check(CLI::Range(0.0, 0.2))
      ->capture_default_str();
  way->add_option("--deformation", flags->deformation, "deformation of the sheet")
      ->type_name("LENSES")
      ->check(CLI::Range(0.0, 0.5))
      ->capture_default_str();
  way->add_option("--pictures", flags->pictures, "folder for the camera's picture of each pattern")
      ->type_name("FOLDER");
  declare_result_flags(*way, flags->result);
  return {.app = way, .run = [flags] { return run_simulate(*flags); }};
}

}  // namespace lenticule::tools
