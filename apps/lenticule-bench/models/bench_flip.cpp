// SPDX-License-Identifier: Apache-2.0
// lenticule bench flip REFERENCE TEST measures FLIP of two pictures.
#include <CLI/CLI.hpp>
#include <memory>
#include <string>

#include "apps/lenticule-bench/harness/bench.h"
#include "apps/lenticule/cli/command.h"
#include "base/print.h"
#include "frames/image_io.h"
#include "lab/flip.h"

namespace lenticule::bench {
namespace {

struct FlipFlags {
  std::string reference;
  std::string test;
  double pixels_per_degree = lab::kFlipPixelsPerDegree;
  bool json = false;
};

ExitCode run_flip(const FlipFlags& flags) {
  const auto prepared = [&](const std::string& file) {
    return lab::FlipPicture(frames::read_woven(file).view(), flags.pixels_per_degree);
  };
  const lab::FlipFigures flip =
      lab::flip_figures(lab::flip_map(prepared(flags.reference), prepared(flags.test)));
  const nlohmann::json figures = {{"mean", flip.mean},
                                  {"percentile_99", flip.percentile_99},
                                  {"pixels_per_degree", flags.pixels_per_degree}};
  if (flags.json)
    print_json(figures);
  else
    print_out("FLIP: mean {:.4f}, 99 % of the pixels at most {:.4f} ({:g} pixels per degree)\n",
              flip.mean, flip.percentile_99, flags.pixels_per_degree);
  return kOk;
}

}  // namespace

cli::Run declare_bench_flip(CLI::App& app) {
  const auto flags = std::make_shared<FlipFlags>();
  app.add_option("REFERENCE", flags->reference, "picture")->required();
  app.add_option("TEST", flags->test, "picture of the same size")->required();
  app.add_option("--pixels-per-degree", flags->pixels_per_degree, "of the viewer")
      ->check(CLI::Range(1.0, 1000.0))
      ->capture_default_str();
  app.add_flag("--json", flags->json, "print as JSON");
  app.footer("Example:\n  lenticule bench flip reference.png test.png");
  return [flags]() -> ExitCode { return run_flip(*flags); };
}

}  // namespace lenticule::bench
