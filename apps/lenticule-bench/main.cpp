// SPDX-License-Identifier: Apache-2.0
// lenticule-bench NAME ... is the program that `lenticule bench NAME ...` runs; its messages use
// the name of that command.
#include <array>
#include <vector>

#include "apps/lenticule/cli/program.h"

namespace lenticule::bench {
cli::Run declare_all_benchmarks(CLI::App& app);
}

int main(int argc, char** argv) {
  using namespace lenticule::bench;
  std::array<char, 6> name = {"bench"};
  std::vector<char*> words(argv, argv + argc);
  words.insert(words.begin() + 1, name.data());
  words.push_back(nullptr);
  const lenticule::cli::Command bench = {"bench", "run a benchmark of this build on this machine",
                                         "lenticule bench exact"};
  const lenticule::cli::Declaration declared = {"bench", declare_all_benchmarks};
  return lenticule::cli::run_program({.commands = {&bench, 1}, .declared = {&declared, 1}},
                                     argc + 1, words.data());
}
