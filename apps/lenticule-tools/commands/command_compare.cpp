// SPDX-License-Identifier: Apache-2.0
// lenticule compare measures the difference between two pictures or sequences.
#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "apps/lenticule-tools/commands/compare_report.h"
#include "apps/lenticule-tools/commands/picture_pairs.h"
#include "apps/lenticule/cli/command.h"
#include "base/error.h"
#include "frames/compare.h"
#include "frames/image_io.h"
#include "frames/measures/flip.h"
#include "frames/quilt.h"
#include "optics/trim.h"
#include "player/process/interrupt.h"
#include "player/process/progress.h"
#include "player/process/rig_choice.h"

namespace lenticule::tools {
namespace {

struct CompareFlags {
  std::string reference;
  std::string test;
  std::string rig;
  int views = 0;
  std::string picture;
  std::optional<double> limit_psnr_db;
  bool flip = false;
  double pixels_per_degree = frames::kFlipPixelsPerDegree;
  bool json = false;
};

void check_limit(const CompareFlags& flags, const nlohmann::json& worst) {
  const nlohmann::json& psnr = worst["total"]["psnr_db"];
  if (!flags.limit_psnr_db || psnr.is_null() || psnr.get<double>() >= *flags.limit_psnr_db) return;
  throw Error(ErrorKind::Quality, fmt::format("{}: {:.2f} dB, below the limit of {} dB",
                                              worst["test"].get<std::string>(), psnr.get<double>(),
                                              *flags.limit_psnr_db));
}

void write_error_picture(const PicturePair& files, const std::string& output) {
  const frames::WovenFrame reference = frames::read_woven(files.reference);
  frames::WovenFrame test(reference.geometry());
  frames::read_woven_into(files.test, test);
  frames::write_woven(frames::error_picture(reference.view(), test.view()).view(), output);
}

ExitCode run_compare(const CompareFlags& flags) {
  if (!flags.picture.empty()) frames::check_writable_format(flags.picture);
  std::optional<optics::OpticalModel> model;
  if (!flags.rig.empty()) model.emplace(optics::load_trimmed_rig(flags.rig));
  int views = flags.views;
  if (model && views == 0) views = frames::native_view_count(model->rig());

  const std::vector<PicturePair> pairs = picture_pairs(flags.reference, flags.test);
  CompareReport measured(model ? &*model : nullptr, views,
                         flags.flip ? std::optional(flags.pixels_per_degree) : std::nullopt);
  player::Progress progress("compare", "frames", pairs.size());
  for (size_t n = 0; n < pairs.size(); ++n) {
    if (player::interrupted()) return player::interrupt_exit_code();
    measured.add(pairs[n]);
    progress.update(n + 1);
  }
  progress.finish();
  const nlohmann::json report = measured.json();
  if (!flags.picture.empty()) write_error_picture(pairs[measured.worst_frame()], flags.picture);
  if (flags.json)
    print_json(report);
  else
    print_compare_report(report);
  check_limit(flags, report["worst"]);
  return kOk;
}

}  // namespace

cli::Run declare_compare(CLI::App& app) {
  const auto flags = std::make_shared<CompareFlags>();
  app.add_option("REFERENCE", flags->reference, "picture, folder or pattern of pictures")
      ->required();
  app.add_option("TEST", flags->test, "picture, folder or pattern to compare with the reference")
      ->required();
  app.add_option("--rig", flags->rig, "rig file: adds figures per view, and SSIM of what eyes see")
      ->type_name("RIG.toml");
  app.add_option("--views", flags->views, "number of views")
      ->default_str("subpixels under a lens")
      ->check(CLI::Range(1, frames::kMaxViews));
  app.add_option("--picture", flags->picture,
                 "picture of where the worst frame differs\n"
                 "Black 0, blue 2, green 8, yellow 27, red 83, white 255 levels.")
      ->type_name("FILE");
  app.add_option("--limit-psnr", flags->limit_psnr_db,
                 "exit code 5 if the worst frame's total PSNR is below this")
      ->type_name("DB");
  CLI::Option* const flip = app.add_flag(
      "--flip", flags->flip, "also measure FLIP: what a viewer notices when the two alternate");
  app.add_option("--pixels-per-degree", flags->pixels_per_degree, "of the viewer, for FLIP")
      ->needs(flip)
      ->check(CLI::Range(1.0, 1000.0))
      ->capture_default_str();
  app.add_flag("--json", flags->json, "print the figures as JSON; psnr_db is null where equal");
  return [flags] {
    if (flags->views != 0) flags->rig = player::choose_rig({.given = flags->rig}).file;
    return run_compare(*flags);
  };
}

}  // namespace lenticule::tools
