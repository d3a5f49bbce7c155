// SPDX-License-Identifier: Apache-2.0
// lenticule bench and lenticule web run programs that have packages of their own.
#include <CLI/CLI.hpp>
#include <string>
#include <vector>

#include "apps/lenticule/cli/command.h"
#include "apps/lenticule/cli/program.h"

namespace lenticule::cli {
namespace {

constexpr OtherProgram kBench = {.name = "lenticule-bench", .package = "lenticule-bench"};
constexpr OtherProgram kWeb = {.name = "lenticule-web", .package = "lenticule-web"};

Run declare_other(CLI::App& app, const OtherProgram& program, const char* command) {
  app.prefix_command();  // all following arguments are for the program,
  app.set_help_flag();   // including --help
  return [&app, &program, command]() -> ExitCode {
    std::vector<std::string> words = app.remaining();
    words.insert(words.begin(), program.name);
    std::vector<char*> pointers;
    for (std::string& word : words) pointers.push_back(word.data());
    pointers.push_back(nullptr);
    become_program(program, command, pointers.data());
  };
}

}  // namespace

Run declare_bench(CLI::App& app) { return declare_other(app, kBench, "bench"); }

Run declare_web(CLI::App& app) { return declare_other(app, kWeb, "web"); }

}  // namespace lenticule::cli
