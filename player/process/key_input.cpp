// SPDX-License-Identifier: Apache-2.0
#include "player/process/key_input.h"

#include <poll.h>
#include <termios.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <atomic>
#include <cerrno>
#include <cstring>

#include "base/error_kinds.h"
#include "base/file.h"
#include "player/process/interrupt.h"

namespace lenticule::player {
namespace {

// Written before g_fd is set, and never changed while it is.
termios g_before{};
std::atomic<int> g_fd{-1};

constexpr size_t kMaxScriptBytes = 1u << 20;

class TerminalKeys final : public KeyInput {
 public:
  [[nodiscard]] std::vector<KeyPress> take() override {
    std::vector<KeyPress> presses;
    std::array<char, 256> bytes{};
    const ssize_t got = read_some(bytes);
    for (ssize_t n = 0; n < got; ++n)
      if (const auto press = decoder_.feed(bytes.at(static_cast<size_t>(n))))
        presses.push_back(*press);
    const auto now = std::chrono::steady_clock::now();
    if (got > 0) {
      last_byte_ = now;
    } else if (decoder_.is_waiting() && now - last_byte_ >= kEscapePause) {
      if (const auto press = decoder_.pause()) presses.push_back(*press);
    }
    return presses;
  }
  [[nodiscard]] bool at_end() const override { return ended_; }
  [[nodiscard]] int fd() const override { return STDIN_FILENO; }
  [[nodiscard]] bool is_person() const override { return true; }

 private:
  /// Reads the available bytes; a terminal that hung up counts as the end.
  ssize_t read_some(std::array<char, 256>& bytes) {
    pollfd ready{.fd = STDIN_FILENO, .events = POLLIN, .revents = 0};
    if (poll(&ready, 1, 0) <= 0) return 0;
    const ssize_t got = read(STDIN_FILENO, bytes.data(), bytes.size());
    const bool later = got < 0 && (errno == EINTR || errno == EAGAIN);
    ended_ = !later && got <= 0;
    return std::max<ssize_t>(got, 0);
  }

  RawTerminal terminal_{STDIN_FILENO};
  KeyDecoder decoder_;
  std::chrono::steady_clock::time_point last_byte_{};
  bool ended_ = false;
};

/// ScriptKeys plays back a script. Repeated equal arrows are delivered together, like those of a
/// key that is held down.
class ScriptKeys final : public KeyInput {
 public:
  explicit ScriptKeys(std::vector<KeyPress> presses) : presses_(std::move(presses)) {}

  [[nodiscard]] std::vector<KeyPress> take() override {
    std::vector<KeyPress> run;
    for (; next_ < presses_.size(); ++next_) {
      const bool is_held =
          !run.empty() && presses_[next_] == run.front() && run.front().key <= Key::SlantMore;
      if (!run.empty() && !is_held) break;
      run.push_back(presses_[next_]);
    }
    return run;
  }
  [[nodiscard]] bool at_end() const override { return next_ == presses_.size(); }
  [[nodiscard]] int fd() const override { return -1; }
  [[nodiscard]] bool is_person() const override { return false; }

 private:
  std::vector<KeyPress> presses_;
  size_t next_ = 0;
};

/// Reads all of standard input, or up to an interrupt.
std::string read_standard_input() {
  std::string text;
  std::array<char, 4096> bytes{};
  while (!interrupted()) {
    std::array<pollfd, 2> ready{{{.fd = STDIN_FILENO, .events = POLLIN, .revents = 0},
                                 {.fd = interrupt_fd(), .events = POLLIN, .revents = 0}}};
    if (poll(ready.data(), ready.size(), 1000) <= 0 || ready[0].revents == 0) continue;
    const ssize_t got = read(STDIN_FILENO, bytes.data(), bytes.size());
    if (got < 0 && errno == EINTR) continue;
    if (got <= 0) break;
    text.append(bytes.data(), static_cast<size_t>(got));
    if (text.size() > kMaxScriptBytes)
      throw Error(ErrorKind::Input, "standard input: script of keys too large");
  }
  return text;
}

}  // namespace

RawTerminal::RawTerminal(int fd) {
  LENTICULE_CHECK(g_fd.load() < 0);
  termios raw{};
  if (tcgetattr(fd, &raw) != 0)
    throw failed_error("terminal: {}", std::strerror(errno))
        .remedy("give the keys in a file: --keys FILE");
  g_before = raw;
  g_fd.store(fd);
  raw.c_lflag &= ~static_cast<tcflag_t>(ICANON | ECHO);
  raw.c_iflag &= ~static_cast<tcflag_t>(IXON);
  raw.c_cc[VSUSP] = _POSIX_VDISABLE;
  raw.c_cc[VMIN] = 0;
  raw.c_cc[VTIME] = 0;
  if (tcsetattr(fd, TCSANOW, &raw) == 0) return;
  const int error = errno;
  restore_terminal_now();
  throw failed_error("terminal: {}", std::strerror(error));
}

RawTerminal::~RawTerminal() { restore_terminal_now(); }

void restore_terminal_now() noexcept {
  const int fd = g_fd.exchange(-1);
  if (fd >= 0) (void)tcsetattr(fd, TCSANOW, &g_before);
}

std::unique_ptr<KeyInput> open_key_input(const std::string& script) {
  if (!script.empty())
    return std::make_unique<ScriptKeys>(
        parse_key_script(read_text_file(script, kMaxScriptBytes), script));
  if (isatty(STDIN_FILENO) == 1) return std::make_unique<TerminalKeys>();
  return std::make_unique<ScriptKeys>(parse_key_script(read_standard_input(), "standard input"));
}

}  // namespace lenticule::player
