// SPDX-License-Identifier: Apache-2.0
// How a benchmark plugs into `lenticule bench`: one file per benchmark, one line in benchmarks.cpp.
#pragma once

#include <string>
#include <vector>

#include "apps/lenticule-bench/harness/bench_rigs.h"
#include "apps/lenticule/cli/command.h"

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

/// 10 log10(255^2 / MSE) in decibels; null where nothing differs.
[[nodiscard]] nlohmann::json psnr_or_null(double mse);
/// Of such a number: with one decimal, or "equal".
[[nodiscard]] std::string decibels(const nlohmann::json& psnr);

/// The middle value; of an even number the mean of the two in the middle. 0 for none.
[[nodiscard]] double median(std::vector<double> values);

}  // namespace lenticule::player
