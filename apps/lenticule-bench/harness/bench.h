// SPDX-License-Identifier: Apache-2.0
// How a benchmark plugs into `lenticule bench`: one file per benchmark, one line in benchmarks.cpp.
#pragma once

#include <string>
#include <vector>

#include "apps/lenticule/cli/command.h"
#include "optics/rig.h"

namespace lenticule::player {

struct Benchmark {
  const char* name;
  const char* summary;
  Declare declare;  ///< flags of `lenticule bench NAME`, as for a command
};

/// Every benchmark, in the order in which `bench list` prints them.
[[nodiscard]] const std::vector<Benchmark>& benchmarks();

/// The machine that numbers belong to: {"cpu", "hardware_threads", "isa"}.
[[nodiscard]] nlohmann::json machine_json();
[[nodiscard]] std::string machine_text();

/// The rig that benchmarks use unless told otherwise: the 4K kiosk of the sample rigs.
[[nodiscard]] optics::Rig kiosk_rig();
/// The classic integral image of the sample rigs: 64 upright lenses of eight whole pixels.
[[nodiscard]] optics::Rig paper_rig();
/// A panel of the same size with pixels `factor` times as wide and high, and lenses of as many
/// subpixels on a sheet that is thicker in proportion: the same viewing zones. For factor 1 the
/// same.
[[nodiscard]] optics::Rig coarser_rig(const optics::Rig& rig, int factor);
/// `file`, or kiosk_rig() if it is empty.
[[nodiscard]] optics::Rig bench_rig(const std::string& file);

/// 10 log10(255^2 / MSE) in decibels; null where nothing differs.
[[nodiscard]] nlohmann::json psnr_or_null(double mse);
/// Of such a number: with one decimal, or "equal".
[[nodiscard]] std::string decibels(const nlohmann::json& psnr);

/// The middle value; of an even number the mean of the two in the middle. 0 for none.
[[nodiscard]] double median(std::vector<double> values);

}  // namespace lenticule::player
