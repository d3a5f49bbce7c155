// SPDX-License-Identifier: Apache-2.0
// Benchmark is an entry of the table of `lenticule bench`: one file per benchmark, one line in
// benchmarks.cpp.
#pragma once

#include <string>
#include <vector>

#include "apps/lenticule/cli/command.h"
#include "base/statistics.h"
#include "lab/fixtures.h"

namespace lenticule::bench {

struct Benchmark {
  const char* name;
  const char* summary;
  cli::Declare declare;  ///< declares the flags of `lenticule bench NAME`, as for a command
};

/// Returns all benchmarks, in the order in which `bench list` prints them.
[[nodiscard]] const std::vector<Benchmark>& benchmarks();

/// Returns the machine on which the numbers were measured: {"cpu", "hardware_threads", "isa"}.
[[nodiscard]] nlohmann::json machine_json();
[[nodiscard]] std::string machine_text();

/// Returns 10 log10(255^2 / MSE) in decibels; null if the MSE is 0.
[[nodiscard]] nlohmann::json psnr_or_null(double mse);
/// Formats such a number with one decimal, or as "equal".
[[nodiscard]] std::string decibels(const nlohmann::json& psnr);

}  // namespace lenticule::bench
