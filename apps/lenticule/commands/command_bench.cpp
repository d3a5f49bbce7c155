// SPDX-License-Identifier: Apache-2.0
// lenticule bench runs lenticule-bench, which has its own package.
#include <fmt/format.h>
#include <unistd.h>

#include <CLI/CLI.hpp>
#include <cerrno>
#include <cstring>
#include <filesystem>
#include <string>
#include <vector>

#include "apps/lenticule/cli/command.h"
#include "base/error.h"
#include "player/process/sibling_program.h"

namespace lenticule::player {
namespace {

constexpr const char* kName = "lenticule-bench";

/// Replaces this process by lenticule-bench. Throws Error(Failed) if that is impossible.
ExitCode become_bench(const std::vector<std::string>& arguments) {
  const auto program = find_sibling_program(kName);
  if (!program)
    throw Error(ErrorKind::Failed, fmt::format("bench: {} is not installed", kName),
                "install the package lenticule-bench");
  std::vector<std::string> words = {program->string()};
  words.insert(words.end(), arguments.begin(), arguments.end());
  std::vector<char*> pointers;
  for (std::string& word : words) pointers.push_back(word.data());
  pointers.push_back(nullptr);
  execv(program->c_str(), pointers.data());
  throw Error(ErrorKind::Failed,
              fmt::format("bench: cannot start {}: {}", program->string(), std::strerror(errno)));
}

}  // namespace

Run declare_bench(CLI::App& app) {
  app.prefix_command();  // all following arguments are for lenticule-bench,
  app.set_help_flag();   // including --help
  return [&app] { return become_bench(app.remaining()); };
}

}  // namespace lenticule::player
