// SPDX-License-Identifier: Apache-2.0
// Calls the program for the command tests and gives each test a folder.
#pragma once

#include <gtest/gtest.h>
#include <unistd.h>

#include <algorithm>
#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "tests/support/process.h"
#include "tests/support/scratch_folder.h"

namespace lenticule::test {

inline std::vector<std::string> program(std::vector<std::string> arguments) {
  arguments.insert(arguments.begin(), LENTICULE_PROGRAM);
  return arguments;
}

/// Returns the words of both.
inline std::vector<std::string> joined(std::vector<std::string> words,
                                       const std::vector<std::string>& more) {
  words.insert(words.end(), more.begin(), more.end());
  return words;
}

inline ProcessResult run(std::vector<std::string> arguments, const ProcessLimits& limits = {}) {
  return run_process(program(std::move(arguments)), limits);
}

/// Says how a program ended, and what it wrote.
inline std::string end_of(const ProcessResult& result) {
  const std::string how = result.timed_out ? "timed out\n"
                          : result.signal  ? "signal " + std::to_string(result.signal) + '\n'
                                           : "";
  return how + result.err + result.out;
}

/// Expects that a program ends with this code, and that its messages have all these texts.
template <typename... Text>
void expect_end(const ProcessResult& result, int exit_code, const Text&... texts) {
  EXPECT_EQ(result.exit_code, exit_code) << end_of(result);
  for (const std::string& text : std::vector<std::string>{texts...})
    EXPECT_NE(result.err.find(text), std::string::npos) << text << " is not in: " << result.err;
}

/// Expects success and returns what a program wrote with --json.
inline nlohmann::json results_of(const ProcessResult& result) {
  EXPECT_EQ(result.exit_code, 0) << end_of(result);
  return nlohmann::json::parse(result.out, nullptr, false);
}

/// Returns the path of a file of the source tree.
inline std::string source_file(const std::string& name) {
  return std::string(LENTICULE_SOURCE_DIR) + "/" + name;
}

/// A fixture that creates a temporary folder per test and removes it at the end.
class CommandTest : public testing::Test {
 protected:
  [[nodiscard]] std::string path(const std::string& name) const {
    return (folder_ / name).string();
  }

  void write(const std::string& name, const std::string& text) const {
    std::ofstream(folder_ / name, std::ios::binary) << text;
  }

  /// Returns the names of all entries of the folder, sorted.
  [[nodiscard]] std::vector<std::string> listing() const {
    std::vector<std::string> names;
    for (const auto& entry : std::filesystem::recursive_directory_iterator(folder_))
      names.push_back(std::filesystem::relative(entry.path(), folder_).string());
    std::sort(names.begin(), names.end());
    return names;
  }

  ScratchFolder scratch_;
  std::filesystem::path folder_ = scratch_.path();
};

}  // namespace lenticule::test
