// SPDX-License-Identifier: Apache-2.0
#include "player/session/preview_window.h"

#include <fmt/format.h>
#include <poll.h>
#include <sys/epoll.h>
#include <unistd.h>

#include <chrono>
#include <vector>

#include "base/error.h"
#include "player/process/child_process.h"

namespace lenticule::player {
namespace {

constexpr const char* kProgram = "lenticule-window";
constexpr std::string_view kSpec = "window";
constexpr int kOpenLimitMs = 30'000;  ///< a busy machine may take seconds to start a program
constexpr std::chrono::seconds kEndLimit{5};
constexpr int kPicturesThere = 3;
constexpr int kReadyThere = 4;

Error program_error(const std::string& what) {
  return {ErrorKind::Device, fmt::format("display 'window': {}", what),
          fmt::format("{} reports the cause above; it needs a desktop session", kProgram)};
}

std::string window_program() {
  if (const auto program = find_sibling_program(kProgram)) return program->string();
  throw Error(ErrorKind::Failed, fmt::format("display 'window': {} is not installed", kProgram),
              "install the package lenticule-window");
}

UniqueFd readable_with_any_of(const std::vector<int>& descriptors) {
  UniqueFd all(::epoll_create1(EPOLL_CLOEXEC));
  for (const int fd : descriptors) {
    epoll_event event{.events = EPOLLIN, .data = {.fd = fd}};
    if (fd >= 0 && ::epoll_ctl(all.get(), EPOLL_CTL_ADD, fd, &event) != 0)
      throw Error(ErrorKind::Failed, "display 'window': no descriptor is left for its end");
  }
  return all;
}

}  // namespace

bool is_window_spec(std::string_view spec) {
  return spec.substr(0, spec.find(':')) == kSpec;
}

std::string virtual_spec_of_window(std::string_view spec) {
  return "virtual" + std::string(spec.substr(kSpec.size()));
}

PreviewWindow::PreviewWindow(const std::string& rig_file, frames::FrameGeometry sent,
                             int interrupt_fd)
    : pictures_(sent.width, sent.height) {
  Pipe pipe = make_pipe();
  program_ = Subprocess({window_program(), "--rig", rig_file, "--pictures",
                         std::to_string(kPicturesThere), "--ready", std::to_string(kReadyThere)},
                        {{.here = pictures_.fd(), .there = kPicturesThere},
                         {.here = pipe.writing.get(), .there = kReadyThere},
                         {.here = STDERR_FILENO, .there = STDERR_FILENO}});
  pipe.writing.reset();
  ready_ = std::move(pipe.reading);
  stop_ = readable_with_any_of({ready_.get(), interrupt_fd});
  pollfd waiting{.fd = stop_.get(), .events = POLLIN, .revents = 0};
  char byte = 0;
  const bool answered = ::poll(&waiting, 1, kOpenLimitMs) == 1;
  pollfd opened{.fd = ready_.get(), .events = POLLIN, .revents = 0};
  const bool interrupted = answered && ::poll(&opened, 1, 0) == 0;
  if (!interrupted && (!answered || ::read(ready_.get(), &byte, 1) != 1))
    throw program_error("the window was not opened");
}

void PreviewWindow::record(const display::ShownFrame& shown,
                           const display::ScanoutView& scanout) noexcept {
  (void)shown;
  pictures_.publish(scanout.pixels, scanout.stride);
}

void PreviewWindow::check() {
  pollfd pipe{.fd = ready_.get(), .events = POLLIN, .revents = 0};
  if (!program_ || ::poll(&pipe, 1, 0) == 0) return;  // it still runs: the player was interrupted
  const auto end = program_.wait_until(std::chrono::steady_clock::now() + kEndLimit);
  if (end && end->exit_code != 0) throw program_error("the window's program failed");
}

}  // namespace lenticule::player
