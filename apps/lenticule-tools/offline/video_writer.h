// SPDX-License-Identifier: Apache-2.0
// VideoWriter writes woven frames to a lossless video file through lenticule-video.
#pragma once

#include <fcntl.h>
#include <poll.h>
#include <sys/socket.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <chrono>
#include <cstdint>
#include <cstring>
#include <filesystem>
#include <optional>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "base/error_kinds.h"
#include "base/subprocess.h"
#include "base/temporary.h"
#include "base/text.h"
#include "base/unique_fd.h"
#include "frames/frame.h"
#include "frames/rational.h"
#include "player/sources/video_probe.h"

namespace lenticule::tools {

enum class VideoCodec {
  Ffv1,     ///< intra-only frames with checksums; the default
  X264Rgb,  ///< H.264 High 4:4:4 with qp 0: smaller for static pictures, slower to seek
};

struct VideoWriterOptions {
  std::filesystem::path file;  ///< Matroska, with any name
  frames::FrameGeometry geometry;
  frames::Rate rate;
  VideoCodec codec = VideoCodec::Ffv1;
  std::filesystem::path program = {};  ///< lenticule-video; empty = search for it
};

/// Writes to a temporary name beside the file; finish() renames it, and without finish() it is
/// removed. Waits at most a minute per frame for the encoder, then throws Error(Failed). Thread
/// safety: one thread.
class VideoWriter {
 public:
  /// Throws Error(Failed) if the file or the encoder cannot be opened.
  explicit VideoWriter(const VideoWriterOptions& options) : options_(options), file_(options.file) {
    if (options_.program.empty()) options_.program = player::find_video_program();
    start();
  }
  VideoWriter(const VideoWriter&) = delete;
  VideoWriter& operator=(const VideoWriter&) = delete;

  /// Writes the next frame, which must have the options' geometry. Throws Error(Failed) with the
  /// encoder's message.
  void write(const frames::FrameView& frame) {
    LENTICULE_CHECK(frame.geometry == options_.geometry);
    std::span<const uint8_t> bytes = frame.bytes;
    const Clock::time_point deadline = Clock::now() + kTimeout;
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
  /// Completes the file and gives it its name. Throws as write().
  void finish() {
    input_.reset();
    const auto ended = wait_until(Clock::now() + kTimeout);
    if (!ended || ended->exit_code != 0) give_up();
    file_.replace_target();
  }

 private:
  using Clock = std::chrono::steady_clock;

  static constexpr std::chrono::seconds kTimeout{60};
  static constexpr std::chrono::milliseconds kLook{50};  ///< pause between two looks at messages
  static constexpr size_t kMostWords = 4096;

  [[noreturn]] static void cannot_write(const std::filesystem::path& file,
                                        const std::string& cause) {
    throw failed_error("{}: cannot write: {}", file.string(), cause);
  }
  void start() {
    std::array<int, 2> in{};
    // A socket instead of a pipe: writing to a dead encoder then returns an error instead of
    // raising a signal.
    if (socketpair(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0, in.data()) != 0)
      cannot_write(options_.file, std::strerror(errno));
    const UniqueFd child_in(in[0]);
    input_ = UniqueFd(in[1]);
    Pipe errors = make_pipe();
    errors_ = std::move(errors.reading);
    fcntl(input_.get(), F_SETFL, O_NONBLOCK);
    fcntl(errors_.get(), F_SETFL, O_NONBLOCK);
    try {
      process_ = Subprocess(arguments(), {{child_in.get(), STDIN_FILENO},
                                          {file_.fd(), STDOUT_FILENO},
                                          {errors.writing.get(), STDERR_FILENO}});
    } catch (const Error& error) {
      cannot_write(options_.file, error.what());
    }
  }

  [[nodiscard]] std::vector<std::string> arguments() const {
    return {options_.program.string(),
            player::kForThisVersion,
            "encode",
            "--width",
            std::to_string(options_.geometry.width),
            "--height",
            std::to_string(options_.geometry.height),
            "--rate",
            frames::to_string(options_.rate),
            "--codec",
            options_.codec == VideoCodec::Ffv1 ? "ffv1" : "x264rgb"};
  }

  void hear() {
    std::array<char, 1024> buffer;
    ssize_t n = 0;
    while ((n = ::read(errors_.get(), buffer.data(), buffer.size())) > 0)
      if (words_.size() < kMostWords) words_.append(buffer.data(), static_cast<size_t>(n));
  }

  [[nodiscard]] std::optional<ProcessEnd> wait_until(Clock::time_point deadline) {
    while (true) {
      hear();  // an encoder with too much to say would wait
      if (const auto ended = process_.wait_until(std::min(deadline, Clock::now() + kLook))) {
        hear();
        return ended;
      }
      if (Clock::now() >= deadline) return std::nullopt;
    }
  }

  /// Reports the encoder's reason if it gave one; a broken pipe is only the consequence.
  [[noreturn]] void give_up() {
    if (process_ && !wait_until(Clock::now() + std::chrono::seconds(1)))
      words_ += "the encoder does not respond";
    const std::string line = words_.substr(0, words_.find('\n'));
    cannot_write(options_.file, line.empty() ? "the encoder crashed" : escaped(line));
  }

  VideoWriterOptions options_;
  TemporaryFile file_;
  UniqueFd input_;   ///< this side of its standard input
  UniqueFd errors_;  ///< this side of its standard error
  std::string words_;
  Subprocess process_;
};

}  // namespace lenticule::tools
