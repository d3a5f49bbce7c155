// SPDX-License-Identifier: Apache-2.0
#include "apps/lenticule-tools/offline/video_writer.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <poll.h>
#include <spawn.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <sys/wait.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <chrono>
#include <csignal>
#include <cstring>
#include <span>
#include <string>
#include <thread>
#include <vector>

#include "base/error.h"
#include "base/temporary.h"
#include "base/text.h"
#include "base/unique_fd.h"
#include "player/sources/video_program.h"

extern char** environ;

namespace lenticule::player {
namespace {

namespace fs = std::filesystem;
using namespace std::chrono_literals;
using Clock = std::chrono::steady_clock;

constexpr auto kPatience = 60s;
constexpr size_t kMostWords = 4096;

[[noreturn]] void cannot_write(const fs::path& file, const std::string& cause) {
  throw Error(ErrorKind::Failed, fmt::format("{}: cannot write: {}", file.string(), cause));
}

}  // namespace

class VideoWriter::Encoder {
 public:
  explicit Encoder(const VideoWriterOptions& options);
  ~Encoder();
  Encoder(const Encoder&) = delete;
  Encoder& operator=(const Encoder&) = delete;

  void write(std::span<const uint8_t> bytes);
  void finish();
  [[nodiscard]] const frames::FrameGeometry& geometry() const { return options_.geometry; }

 private:
  void start();
  [[nodiscard]] std::vector<std::string> arguments() const;
  void hear();
  [[nodiscard]] bool wait_until(Clock::time_point deadline, int& status);
  [[noreturn]] void give_up();

  VideoWriterOptions options_;
  TemporaryFile file_;
  UniqueFd input_;   ///< this side of its standard input
  UniqueFd errors_;  ///< this side of its standard error
  std::string words_;
  pid_t pid_ = -1;
};

VideoWriter::Encoder::Encoder(const VideoWriterOptions& options)
    : options_(options), file_(options.file) {
  if (options_.program.empty()) options_.program = find_video_program();
  start();
}

VideoWriter::Encoder::~Encoder() {
  if (pid_ > 0) {
    ::kill(pid_, SIGKILL);
    while (waitpid(pid_, nullptr, 0) < 0 && errno == EINTR) {
    }
  }
}

std::vector<std::string> VideoWriter::Encoder::arguments() const {
  return {options_.program.string(),
          "encode",
          "--width",
          std::to_string(options_.geometry.width),
          "--height",
          std::to_string(options_.geometry.height),
          "--rate",
          frames::to_string(options_.rate),
          "--codec",
          options_.codec == VideoCodec::Ffv1 ? "ffv1" : "x264rgb",
          "-"};
}

void VideoWriter::Encoder::start() {
  std::array<int, 2> in{};
  std::array<int, 2> err{};
  // A socket instead of a pipe: writing to a dead encoder then returns an error instead of raising
  // a signal.
  if (socketpair(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0, in.data()) != 0)
    cannot_write(options_.file, std::strerror(errno));
  const UniqueFd child_in(in[0]);
  input_ = UniqueFd(in[1]);
  if (pipe2(err.data(), O_CLOEXEC) != 0) cannot_write(options_.file, std::strerror(errno));
  errors_ = UniqueFd(err[0]);
  const UniqueFd child_err(err[1]);
  fcntl(input_.get(), F_SETFL, O_NONBLOCK);
  fcntl(errors_.get(), F_SETFL, O_NONBLOCK);
  posix_spawn_file_actions_t actions;
  posix_spawn_file_actions_init(&actions);
  posix_spawn_file_actions_adddup2(&actions, child_in.get(), STDIN_FILENO);
  posix_spawn_file_actions_adddup2(&actions, file_.fd(), STDOUT_FILENO);
  posix_spawn_file_actions_adddup2(&actions, child_err.get(), STDERR_FILENO);
  const std::vector<std::string> words = arguments();
  std::vector<char*> argv;
  argv.reserve(words.size() + 1);
  for (const std::string& word : words) argv.push_back(const_cast<char*>(word.c_str()));
  argv.push_back(nullptr);
  // A process group of its own, so that Ctrl-C reaches only this process, which keeps the part
  // written so far.
  posix_spawnattr_t attributes;
  posix_spawnattr_init(&attributes);
  posix_spawnattr_setflags(&attributes, POSIX_SPAWN_SETPGROUP);
  const int error = posix_spawn(&pid_, argv[0], &actions, &attributes, argv.data(), environ);
  posix_spawnattr_destroy(&attributes);
  posix_spawn_file_actions_destroy(&actions);
  if (error == 0) return;
  pid_ = -1;
  cannot_write(options_.file, fmt::format("{}: {}", words[0], std::strerror(error)));
}

void VideoWriter::Encoder::hear() {
  std::array<char, 1024> buffer;
  ssize_t n = 0;
  while ((n = ::read(errors_.get(), buffer.data(), buffer.size())) > 0)
    if (words_.size() < kMostWords) words_.append(buffer.data(), static_cast<size_t>(n));
}

void VideoWriter::Encoder::write(std::span<const uint8_t> bytes) {
  const Clock::time_point deadline = Clock::now() + kPatience;
  while (!bytes.empty()) {
    const ssize_t n = ::send(input_.get(), bytes.data(), bytes.size(), MSG_NOSIGNAL);
    if (n > 0) {
      bytes = bytes.subspan(static_cast<size_t>(n));
      continue;
    }
    if (errno == EINTR) continue;
    if (errno != EAGAIN || Clock::now() >= deadline) give_up();
    hear();
    pollfd room{.fd = input_.get(), .events = POLLOUT, .revents = 0};
    (void)poll(&room, 1, 200);
  }
}

bool VideoWriter::Encoder::wait_until(Clock::time_point deadline, int& status) {
  while (true) {
    hear();
    const pid_t ended = waitpid(pid_, &status, WNOHANG);
    if (ended == pid_) break;
    if (Clock::now() >= deadline) return false;
    std::this_thread::sleep_for(1ms);
  }
  pid_ = -1;
  hear();
  return true;
}

void VideoWriter::Encoder::finish() {
  input_.reset();
  int status = 0;
  if (!wait_until(Clock::now() + kPatience, status) || !WIFEXITED(status) ||
      WEXITSTATUS(status) != 0)
    give_up();
  file_.replace_target();
}

/// Reports the encoder's reason if it gave one; a broken pipe is only the consequence.
void VideoWriter::Encoder::give_up() {
  int status = 0;
  if (pid_ > 0 && !wait_until(Clock::now() + 1s, status)) words_ += "the encoder does not go on";
  const std::string line = words_.substr(0, words_.find('\n'));
  cannot_write(options_.file, line.empty() ? "the encoder crashed" : escaped(line));
}

VideoWriter::VideoWriter(const VideoWriterOptions& options)
    : encoder_(std::make_unique<Encoder>(options)) {}
VideoWriter::~VideoWriter() = default;

void VideoWriter::write(const frames::FrameView& frame) {
  LENTICULE_CHECK(frame.geometry == encoder_->geometry());
  encoder_->write(frame.bytes);
}

void VideoWriter::finish() {
  encoder_->finish();
}

}  // namespace lenticule::player
