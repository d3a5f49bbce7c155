// SPDX-License-Identifier: Apache-2.0
// Declares what all benchmarks share: the machine's name, tables and flags. Each benchmark has one
// file, and one line in benchmarks.cpp.
#pragma once

#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "apps/lenticule/cli/command.h"
#include "base/statistics.h"
#include "lab/fixtures.h"

namespace lenticule::bench {

/// Returns the machine on which the numbers were measured: {"cpu", "hardware_threads", "isa"}.
[[nodiscard]] nlohmann::json machine_json();
[[nodiscard]] std::string machine_text();

/// Returns 10 log10(255^2 / MSE) in decibels; null if the MSE is 0.
[[nodiscard]] nlohmann::json psnr_or_null(double mse);
/// Formats such a number with one decimal, or as "equal".
[[nodiscard]] std::string decibels(const nlohmann::json& psnr);

/// Column is one of a table's columns.
struct Column {
  const char* head;
  const char* key;  ///< names a value of a row, a JSON object; a slash leads into another object
  const char* format = "{:.0f}";  ///< shows a number
  double factor = 1.0;            ///< multiplies a number before it is shown
  const char* null = "-";         ///< stands for null; a missing key is "-"
};
/// Prints the rows below the heads of their columns. Columns of text are aligned to the left.
void print_table(const nlohmann::json& rows, std::span<const Column> columns,
                 std::string_view indent = "");

/// RunFlags are flags of most benchmarks.
struct RunFlags {
  std::string rig;
  int runs = 5;
  int threads = 0;  ///< 0 = all cores
  bool json = false;
};
/// Declares --rig, --runs and --json.
void declare_run_flags(CLI::App& app, RunFlags& flags);
void declare_threads(CLI::App& app, int& threads);
/// Declares the number of bounces of mirrored and refracted rays.
void declare_depth(CLI::App& app, const char* name, int& depth);

}  // namespace lenticule::bench
