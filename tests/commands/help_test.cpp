// SPDX-License-Identifier: Apache-2.0
// Tests the help of every command.
#include <map>
#include <sstream>

#include "tests/commands/program.h"

namespace lenticule::test {
namespace {

std::vector<std::string> command_names_from_help(std::vector<std::string> command = {}) {
  command.emplace_back("--help");
  std::istringstream help(run(command).out);
  std::vector<std::string> names;
  bool listing = false;
  for (std::string line; std::getline(help, line);) {
    if (line.rfind("Subcommands", 0) == 0) {
      listing = true;
      continue;
    }
    if (line.empty()) listing = false;
    if (!listing || line.size() < 3 || line.rfind("  ", 0) != 0 || line[2] == ' ') continue;
    names.push_back(line.substr(2, line.find(' ', 2) - 2));
  }
  return names;
}

TEST(Help, ListsTheCommandsOfTheContract) {
  const auto names = command_names_from_help();
  for (const char* name : {"render", "play", "weave", "eye", "compare", "rig", "scene", "bench"})
    EXPECT_NE(std::find(names.begin(), names.end(), name), names.end()) << name;
}

// Asks for the help of each first step, so that every step names a command that exists.
TEST(Help, ShowsFirstStepsAndExitsWithTwoWithoutACommand) {
  const ProcessResult result = run({});
  EXPECT_EQ(result.exit_code, 2);
  EXPECT_TRUE(result.out.empty()) << result.out;
  const std::string help = run({"--help"}).out;
  std::istringstream lines(result.err);
  int steps = 0;
  for (std::string line; std::getline(lines, line);) {
    const size_t begin = line.find("  lenticule ");
    if (begin == std::string::npos) continue;
    ++steps;
    EXPECT_NE(help.find(line), std::string::npos) << line;
    std::istringstream words(line.substr(begin + 2));
    std::string program, command;
    words >> program >> command;
    EXPECT_EQ(run({command, "--help"}).exit_code, 0) << command;
  }
  EXPECT_EQ(steps, 5);
}

TEST(Help, EveryCommandsHelpEndsWithAnExampleAndExitsWithZero) {
  for (const std::string& name : command_names_from_help()) {
    const ProcessResult result = run({name, "--help"});
    EXPECT_EQ(result.exit_code, 0) << name;
    EXPECT_NE(result.out.find("Example:\n  lenticule " + name), std::string::npos) << result.out;
    EXPECT_TRUE(result.err.empty()) << result.err;
  }
}

/// Calls `check` for the help of each command and of its subcommands.
template <class Check>
void for_each_help(const Check& check, const std::vector<std::string>& above = {}) {
  for (const std::string& name : command_names_from_help(above)) {
    if (name == "bench" || name == "web") continue;  // other programs
    std::vector<std::string> command = above;
    command.push_back(name);
    for_each_help(check, command);
    std::string typed = "lenticule";
    for (const std::string& word : command) typed += " " + word;
    command.emplace_back("--help");
    check(typed, run(command).out);
  }
}

TEST(Help, EverySubcommandsHelpHasItsOwnExample) {
  for_each_help([](const std::string& command, const std::string& help) {
    const size_t example = help.find("\nExample");
    ASSERT_NE(example, std::string::npos) << command;
    EXPECT_NE(help.find("\n  " + command, example), std::string::npos) << help;
  });
}

TEST(Help, StatesValuesLimitsAndDefaultsInOneStyle) {
  for_each_help([](const std::string& command, const std::string& help) {
    for (const char* other : {" TEXT", " FLOAT", " INT", " UINT", "(default", " in [", "REQUIRED",
                              "Excludes:", "Needs:"})
      EXPECT_EQ(help.find(other), std::string::npos) << command << ": " << other << "\n" << help;
    std::istringstream lines(help);
    for (std::string line; std::getline(lines, line);)
      EXPECT_LE(line.size(), 100u) << command << ": " << line;
  });
  const std::string play = run({"play", "--help"}).out;
  for (const char* text : {"--slots N ", "[2 to 4096; default: 8]", "--clock real|simulated ",
                           "--duration SECONDS ", "--fps RATE ", "[required]"})
    EXPECT_NE(play.find(text), std::string::npos) << text << "\n" << play;
}

TEST(Help, OfPlayBeginsWithTheTenFlagsThatPeopleNeedFirst) {
  std::istringstream lines(run({"play", "--help"}).out);
  std::map<std::string, int> flags;
  std::string group;
  for (std::string line; std::getline(lines, line);) {
    if (line.ends_with(':') && line[0] != ' ') group = line;
    if (line.starts_with("  --")) ++flags[group];
  }
  EXPECT_EQ(flags["Options:"], 10);
  for (const char* name : {"Layout of views:", "Weaving:", "Display:", "Timing:",
                           "Players in step:", "Control and statistics:", "Service:"})
    EXPECT_GE(flags[name], 3) << name;
}

TEST(Help, LongTextsAreInTheManual) {
  const std::string text = "escape undoes all changes", help = run({"play", "--help"}).out;
  EXPECT_EQ(help.find(text), std::string::npos);
  EXPECT_NE(help.find("lenticule man"), std::string::npos);
  EXPECT_NE(run({"man"}).out.find(text), std::string::npos);
}

TEST(Help, EveryCommandThatPrintsAcceptsJson) {
  for (const auto& command : std::vector<std::vector<std::string>>{{"render"},
                                                                   {"play"},
                                                                   {"weave"},
                                                                   {"eye"},
                                                                   {"compare"},
                                                                   {"rig", "show"},
                                                                   {"scene", "list"},
                                                                   {"bench", "list"},
                                                                   {"bench", "exact"}}) {
    std::vector<std::string> arguments = command;
    arguments.emplace_back("--help");
    EXPECT_NE(run(arguments).out.find("--json"), std::string::npos)
        << command.front() << " " << command.back();
  }
}

TEST(Help, AnUnknownFlagOrCommandIsAUsageErrorOnStandardError) {
  for (const auto& arguments :
       {std::vector<std::string>{"fly"}, {"render", "--fast"}, {}, {"rig", "polish"}}) {
    const ProcessResult result = run(arguments);
    EXPECT_EQ(result.exit_code, 2);
    EXPECT_TRUE(result.out.empty()) << result.out;
    EXPECT_NE(result.err.find("--help"), std::string::npos) << result.err;
  }
}

TEST(Help, ManualNamesEveryCommand) {
  const std::string manual = run({"man"}).out;
  for (const std::string& name : command_names_from_help())
    EXPECT_NE(manual.find(".SS " + name), std::string::npos) << name;
}

TEST(Help, AFullStandardOutputIsAFailureNotASuccess) {
  expect_end(run_process({"/bin/sh", "-c", std::string(LENTICULE_PROGRAM) + " man > /dev/full"}),
             1);
}

void expect_refuses_the_instruction_set(const std::vector<std::string>& command) {
  const ProcessResult result = run_process(joined({"/usr/bin/env", "LENTICULE_ISA=sse2"}, command));
  EXPECT_EQ(result.exit_code, 2) << command[1] << ": signal " << result.signal;
  EXPECT_TRUE(result.out.empty()) << result.out;
  EXPECT_NE(result.err.find("LENTICULE_ISA: no instruction set 'sse2'"), std::string::npos)
      << command[1] << ": " << result.err;
  EXPECT_NE(result.err.find("baseline, neon, avx2 or avx512"), std::string::npos) << result.err;
}

TEST(Environment, AnUnknownInstructionSetIsAUsageErrorOfEveryCommand) {
  for (const std::string& name : command_names_from_help())
    expect_refuses_the_instruction_set(program({name}));
  expect_refuses_the_instruction_set({LENTICULE_VIDEO_PROGRAM, "probe", "none.mkv"});
}

TEST(Environment, AnInstructionSetThatTheProcessorLacksGivesTheBestBelowIt) {
  expect_end(run_process({"/usr/bin/env", "LENTICULE_ISA=avx512", LENTICULE_PROGRAM, "render",
                          "builtin:demo", "--rig", source_file("scenes/rigs/tiny.toml"), "-o",
                          ::testing::TempDir() + "lenticule-isa.png", "--overwrite"}),
             0);
}

}  // namespace
}  // namespace lenticule::test
