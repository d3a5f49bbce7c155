// SPDX-License-Identifier: Apache-2.0
#include "base/print.h"

#include <fcntl.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <array>
#include <csignal>
#include <cstdio>
#include <string>

#include "base/error.h"
#include "base/unique_fd.h"

namespace lenticule {
namespace {

/// Replaces a standard descriptor by `fd` during its lifetime.
class Redirected {
 public:
  Redirected(int standard, int fd) : standard_(standard), before_(dup(standard)) {
    std::fflush(nullptr);
    dup2(fd, standard);
  }
  ~Redirected() {
    std::fflush(nullptr);
    std::clearerr(stdout);
    dup2(before_.get(), standard_);
  }
  Redirected(const Redirected&) = delete;
  Redirected& operator=(const Redirected&) = delete;

 private:
  int standard_;
  UniqueFd before_;
};

struct Pipe {
  Pipe() {
    std::array<int, 2> ends{};
    if (pipe2(ends.data(), O_CLOEXEC) != 0) throw std::runtime_error("pipe2 failed");
    reader = UniqueFd(ends[0]);
    writer = UniqueFd(ends[1]);
  }
  /// Returns the bytes that are in the pipe now.
  [[nodiscard]] std::string read_all() const {
    std::string text(1 << 17, '\0');
    const ssize_t n = read(reader.get(), text.data(), text.size());
    text.resize(n > 0 ? static_cast<size_t>(n) : 0);
    return text;
  }

  UniqueFd reader;
  UniqueFd writer;
};

UniqueFd full_device() { return UniqueFd(open("/dev/full", O_WRONLY | O_CLOEXEC)); }

TEST(Print, DiagnosticsForAFullDiskAreDroppedAndCounted) {
  const UniqueFd full = full_device();
  const uint64_t before = dropped_log_lines();
  {
    const Redirected redirected(STDERR_FILENO, full.get());
    say("one line\n");
    say("two\nlines: {}\n", 7);
    say("\r a bar that is drawn again");
  }
  EXPECT_EQ(dropped_log_lines() - before, 3u);
}

TEST(Print, DiagnosticsForAReaderThatIsGoneAreDroppedAndCounted) {
  std::signal(SIGPIPE, SIG_IGN);
  Pipe pipe;
  pipe.reader.reset();
  const uint64_t before = dropped_log_lines();
  {
    const Redirected redirected(STDERR_FILENO, pipe.writer.get());
    say("nobody reads this\n");
  }
  EXPECT_EQ(dropped_log_lines() - before, 1u);
}

// The test hangs if the printer waits without a limit.
TEST(Print, DiagnosticsDoNotWaitForAReaderThatDoesNotRead) {
  const Pipe pipe;
  const uint64_t before = dropped_log_lines();
  const std::string line(999, 'x');
  constexpr uint64_t kLines = 3000;
  std::string first;
  {
    const Redirected redirected(STDERR_FILENO, pipe.writer.get());
    for (uint64_t i = 0; i < kLines; ++i) say("{}\n", line);
    first = pipe.read_all();
    say("heard again\n");
  }
  const auto held = static_cast<uint64_t>(std::count(first.begin(), first.end(), '\n'));
  EXPECT_GT(held, 0u);
  EXPECT_EQ(dropped_log_lines() - before, kLines - held);
  EXPECT_EQ(pipe.read_all(), "heard again\n") << "nothing stays shut for ever";
}

TEST(Print, TextsThatAreArgumentsAreEscapedAndTheFormatIsNot) {
  const Pipe pipe;
  {
    const Redirected redirected(STDERR_FILENO, pipe.writer.get());
    say("\r\x1b[K{}: {:>4} {} {}{}\n", std::filesystem::path("a\x1b[2J\n.png"), 12, "\x9b",
        Verbatim{"our\nown"}, '\x07');
  }
  EXPECT_EQ(pipe.read_all(), "\r\x1b[Ka\\x1b[2J\\x0a.png:   12 \\x9b our\nown\\x07\n");
}

TEST(Print, ResultsAreEscapedToo) {
  const Pipe pipe;
  {
    const Redirected redirected(STDOUT_FILENO, pipe.writer.get());
    print_out("{}\n", std::string("\x1b]0;x\x07"));
    finish_results();
  }
  EXPECT_EQ(pipe.read_all(), "\\x1b]0;x\\x07\n");
}

TEST(Print, ResultsThatCannotBeWrittenAreAnErrorWithAReason) {
  const UniqueFd full = full_device();
  const Redirected redirected(STDOUT_FILENO, full.get());
  try {
    print_out("{}\n", "a result");
    finish_results();
    FAIL() << "a full disk took it";
  } catch (const Error& error) {
    EXPECT_EQ(error.kind(), ErrorKind::Failed);
    EXPECT_STREQ(error.what(), "standard output: cannot write: No space left on device");
  }
}

TEST(Print, ManyResultsThatCannotBeWrittenAreAnErrorToo) {
  const UniqueFd full = full_device();
  const Redirected redirected(STDOUT_FILENO, full.get());
  EXPECT_THROW(
      {
        for (int i = 0; i < 100'000; ++i) print_out("result {}\n", i);
        finish_results();
      },
      Error);
}

}  // namespace
}  // namespace lenticule
