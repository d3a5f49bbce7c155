// SPDX-License-Identifier: Apache-2.0
// lenticule bench runs lenticule-bench, which has its own package.
#include <CLI/CLI.hpp>
#include <string>
#include <vector>

#include "apps/lenticule/cli/command.h"
#include "apps/lenticule/cli/other_program.h"

namespace lenticule::player {
namespace {

constexpr OtherProgram kBench = {.name = "lenticule-bench", .package = "lenticule-bench"};

ExitCode become_bench(std::vector<std::string> words) {
  words.insert(words.begin(), kBench.name);
  std::vector<char*> pointers;
  for (std::string& word : words) pointers.push_back(word.data());
  pointers.push_back(nullptr);
  become_program(kBench, "bench", pointers.data());
}

}  // namespace

Run declare_bench(CLI::App& app) {
  app.prefix_command();  // all following arguments are for lenticule-bench,
  app.set_help_flag();   // including --help
  return [&app] { return become_bench(app.remaining()); };
}

}  // namespace lenticule::player
