// SPDX-License-Identifier: Apache-2.0
#include "base/subprocess.h"

#include <fcntl.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/mman.h>
#include <sys/wait.h>
#include <unistd.h>

#include <csignal>
#include <cstdio>
#include <cstdlib>

#include "base/error.h"

namespace lenticule {
namespace {

using namespace std::chrono_literals;
using Clock = std::chrono::steady_clock;

constexpr auto kLong = 60s;

bool never() { return false; }

ProgramRun run(const std::vector<std::string>& arguments, std::chrono::milliseconds limit = kLong) {
  return run_and_capture(arguments, limit, never);
}

ProgramRun shell(const char* script, std::chrono::milliseconds limit = kLong) {
  return run({"/bin/sh", "-c", script}, limit);
}

/// Returns true if the program's mask in /proc/self/status contains the signal.
bool mask_contains(const char* mask, int signal) {
  const std::string script = std::string("s/^") + mask + ":\\t//p";
  const std::string digits = run({"/bin/sed", "-n", script, "/proc/self/status"}).output;
  EXPECT_EQ(digits.size(), 17U) << digits;
  return (std::strtoull(digits.c_str(), nullptr, 16) >> (signal - 1) & 1U) != 0;
}

UniqueFd memory_file(const std::string& text) {
  UniqueFd file(memfd_create("test", MFD_CLOEXEC));
  EXPECT_EQ(write(file.get(), text.data(), text.size()), static_cast<ssize_t>(text.size()));
  return file;
}

TEST(RunAndCapture, KeepsBothStreamsAndTheExitCode) {
  const ProgramRun result = shell("echo one; echo two >&2; exit 3");
  EXPECT_EQ(result.output, "one\ntwo\n");
  EXPECT_EQ(result.exit_code, 3);
  EXPECT_FALSE(result.timed_out);
}

TEST(RunAndCapture, ReportsASignalAsExitCodeMinusOne) {
  const ProgramRun result = shell("kill -KILL $$");
  EXPECT_EQ(result.exit_code, -1);
  EXPECT_FALSE(result.timed_out);
}

TEST(RunAndCapture, GivesAnEmptyStandardInput) { EXPECT_EQ(run({"/bin/sed", "p"}).output, ""); }

TEST(RunAndCapture, KeepsTheEndOfLongOutput) {
  const ProgramRun result = shell("head -c 20000000 /dev/zero; echo the end");
  EXPECT_THAT(result.output, ::testing::EndsWith("the end\n"));
  EXPECT_LT(result.output.size(), 10'000'000U);
}

TEST(RunAndCapture, EndsAProgramAtItsLimit) {
  const ProgramRun result = shell("echo before; exec sleep 600", 300ms);
  EXPECT_TRUE(result.timed_out);
  EXPECT_EQ(result.exit_code, -1);
  EXPECT_EQ(result.output, "before\n");
}

TEST(RunAndCapture, EndsAProgramThatClosedItsOutputAtItsLimit) {
  const ProgramRun result = shell("exec >&- 2>&-; exec sleep 600", 300ms);
  EXPECT_TRUE(result.timed_out);
  EXPECT_EQ(result.exit_code, -1);
}

TEST(RunAndCapture, EndsDescendantsThatKeepTheOutputOpenAtItsLimit) {
  const ProgramRun result = shell("sleep 600 & echo $!", 300ms);
  EXPECT_TRUE(result.timed_out);
  const pid_t descendant = std::atoi(result.output.c_str());
  ASSERT_GT(descendant, 0);
  for (int wait = 0; wait < 1000 && kill(descendant, 0) == 0; ++wait) usleep(1000);
  const std::string state =
      run({"/bin/sed", "-n", "s/^State:\\t//p", "/proc/" + std::to_string(descendant) + "/status"})
          .output;
  EXPECT_FALSE(state.starts_with("S")) << "asleep: still runs";
}

TEST(RunAndCapture, EndsAProgramWhenTheCallerStops) {
  const ProgramRun result = run_and_capture({"/bin/sleep", "600"}, kLong, [] { return true; });
  EXPECT_FALSE(result.timed_out);
  EXPECT_EQ(result.exit_code, -1);
}

TEST(RunAndCapture, NamesAProgramThatCannotBeStarted) {
  try {
    (void)run({"/nowhere/program"});
    FAIL();
  } catch (const Error& error) {
    EXPECT_EQ(error.kind(), ErrorKind::Failed);
    EXPECT_STREQ(error.what(), "/nowhere/program: cannot start: No such file or directory");
  }
}

TEST(Subprocess, StartsWithNoSignalBlockedOrIgnored) {
  sigset_t blocked, before;
  sigemptyset(&blocked);
  sigaddset(&blocked, SIGUSR1);
  sigaddset(&blocked, SIGTERM);
  pthread_sigmask(SIG_BLOCK, &blocked, &before);
  auto* const handler = std::signal(SIGPIPE, SIG_IGN);
  EXPECT_FALSE(mask_contains("SigBlk", SIGUSR1));
  EXPECT_FALSE(mask_contains("SigBlk", SIGTERM));
  EXPECT_FALSE(mask_contains("SigIgn", SIGPIPE));
  std::signal(SIGPIPE, handler);
  pthread_sigmask(SIG_SETMASK, &before, nullptr);
}

TEST(Subprocess, HasItsOwnProcessGroup) {
  const std::string statistics = run({"/bin/sed", "s/(.*)//", "/proc/self/stat"}).output;
  int pid = 0, group = 0;
  ASSERT_EQ(std::sscanf(statistics.c_str(), "%d %*c %*d %d", &pid, &group), 2) << statistics;
  EXPECT_EQ(pid, group);
}

TEST(Subprocess, HasOnlyThePassedDescriptors) {
  const UniqueFd inherited(fcntl(STDERR_FILENO, F_DUPFD, 100));
  ASSERT_TRUE(inherited);
  EXPECT_EQ(run({"/bin/ls", "/proc/self/fd"}).output, "0\n1\n2\n3\n") << "3 is the listed folder";
}

TEST(Subprocess, PassesDescriptorsWhoseNumbersOverlap) {
  const UniqueFd first(fcntl(memory_file("first\n").get(), F_DUPFD_CLOEXEC, 105));
  const UniqueFd second(fcntl(memory_file("second\n").get(), F_DUPFD_CLOEXEC, first.get() + 1));
  const int a = first.get(), b = second.get();
  Pipe pipe = make_pipe();
  Subprocess program(
      {"/bin/sed", "", "/proc/self/fd/" + std::to_string(a), "/proc/self/fd/" + std::to_string(b)},
      {{a, b}, {b, a}, {pipe.writing.get(), STDOUT_FILENO}});
  const auto ended = program.wait_until(Clock::now() + kLong);
  ASSERT_TRUE(ended.has_value());
  EXPECT_EQ(ended->exit_code, 0);
  std::string text(100, '\0');
  text.resize(static_cast<size_t>(read(pipe.reading.get(), text.data(), text.size())));
  EXPECT_EQ(text, "second\nfirst\n");
}

TEST(Subprocess, ReturnsNoEndWhileTheProcessRuns) {
  Subprocess program({"/bin/sleep", "600"});
  EXPECT_FALSE(program.wait_until(Clock::now() + 20ms).has_value());
  EXPECT_TRUE(program);
  program.kill();
  const auto ended = program.wait_until(Clock::now() + kLong);
  ASSERT_TRUE(ended.has_value());
  EXPECT_EQ(ended->signal, SIGKILL);
  EXPECT_EQ(ended->exit_code, -1);
  EXPECT_FALSE(program);
}

TEST(Subprocess, IsKilledAndReapedAtDestruction) {
  pid_t pid = -1;
  {
    const Subprocess program({"/bin/sleep", "600"});
    pid = program.pid();
    EXPECT_EQ(kill(pid, 0), 0);
  }
  EXPECT_EQ(kill(pid, 0), -1);
}

TEST(Subprocess, EndKeepsTheExitCodeOfAProcessThatHasEnded) {
  Subprocess program({"/bin/sh", "-c", "exit 7"});
  siginfo_t state{};
  ASSERT_EQ(waitid(P_PID, static_cast<id_t>(program.pid()), &state, WEXITED | WNOWAIT), 0);
  EXPECT_EQ(program.end().exit_code, 7);
}

}  // namespace
}  // namespace lenticule
