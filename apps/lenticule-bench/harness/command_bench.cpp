// SPDX-License-Identifier: Apache-2.0
// lenticule bench lists and runs the benchmarks of benchmarks.cpp.
#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <map>
#include <memory>

#include "apps/lenticule-bench/harness/bench.h"
#include "apps/lenticule/cli/command.h"
#include "base/print.h"

namespace lenticule::bench {
namespace {

cli::Run declare_list(CLI::App& app) {
  auto json = std::make_shared<bool>(false);
  app.add_flag("--json", *json, "print as JSON");
  return [json]() -> ExitCode {
    nlohmann::json list = nlohmann::json::array();
    for (const Benchmark& benchmark : benchmarks())
      list.push_back({{"name", benchmark.name}, {"summary", benchmark.summary}});
    if (*json) {
      print_json(list);
      return kOk;
    }
    for (const auto& entry : list)
      print_out("{:<10} {}\n", entry["name"].get<std::string>(),
                entry["summary"].get<std::string>());
    return kOk;
  };
}

}  // namespace

cli::Run declare_all_benchmarks(CLI::App& app) {
  app.require_subcommand(1);
  auto runs = std::make_shared<std::map<const CLI::App*, cli::Run>>();
  CLI::App* list = app.add_subcommand("list", "list the benchmarks");
  (*runs)[list] = declare_list(*list);
  for (const Benchmark& benchmark : benchmarks()) {
    CLI::App* sub = app.add_subcommand(benchmark.name, benchmark.summary);
    sub->footer(fmt::format("Example:\n  lenticule bench {}", benchmark.name));
    (*runs)[sub] = benchmark.declare(*sub);  // a benchmark may set its own example
  }
  return [&app, runs]() -> ExitCode { return runs->at(app.get_subcommands().front())(); };
}

}  // namespace lenticule::bench
