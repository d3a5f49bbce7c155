// SPDX-License-Identifier: Apache-2.0
#include "player/sources/video_child.h"

#include <fmt/format.h>
#include <poll.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <utility>

#include "base/error.h"
#include "base/text.h"

namespace lenticule::player {
namespace {

constexpr size_t kMostLine = 4096;
constexpr int kPollMilliseconds = 200;

}  // namespace

std::string ChildEnd::text() const {
  const std::string how = signal != 0 ? fmt::format("killed by signal {}", signal)
                                      : fmt::format("exit code {}", exit_code);
  return last_words.empty() ? how : fmt::format("{} ({})", last_words, how);
}

VideoChild::VideoChild() : keeper_([this] { look_after(); }) {}

VideoChild::~VideoChild() {
  {
    const std::lock_guard lock(mutex_);
    stopping_ = true;
    kill_ = true;
  }
  wanted_.notify_all();
  nudge_.signal();
  keeper_.join();
}

void VideoChild::start(std::vector<std::string> arguments) {
  LENTICULE_CHECK(!present_ && arguments.size() >= 2);
  present_ = true;
  broken_.store(0);
  rounds_.store(0);
  arguments.insert(arguments.begin() + 2, {"--parent", std::to_string(getpid())});
  {
    const std::lock_guard lock(mutex_);
    arguments_ = std::move(arguments);
    kill_ = false;
  }
  wanted_.notify_all();
}

void VideoChild::kill() {
  {
    const std::lock_guard lock(mutex_);
    kill_ = true;
  }
  nudge_.signal();
}

std::optional<ChildEnd> VideoChild::take_end() {
  const std::lock_guard lock(mutex_);
  if (!end_) return std::nullopt;
  ended_.drain();
  present_ = false;
  return std::exchange(end_, std::nullopt);
}

pid_t VideoChild::pid() const {
  const std::lock_guard lock(mutex_);
  return pid_;
}

std::optional<VideoEvent> VideoChild::position() const {
  const std::lock_guard lock(mutex_);
  return position_;
}

std::optional<VideoEvent> VideoChild::decoder() const {
  const std::lock_guard lock(mutex_);
  return decoder_;
}

// --- the keeper thread -------------------------------------------------------------------------

void VideoChild::look_after() {
  while (true) {
    std::vector<std::string> arguments;
    {
      std::unique_lock lock(mutex_);
      wanted_.wait(lock, [this] { return stopping_ || !arguments_.empty(); });
      if (stopping_) return;
      arguments = std::exchange(arguments_, {});
      last_words_.clear();
    }
    keep(arguments);
  }
}

void VideoChild::keep(const std::vector<std::string>& arguments) {
  Pipe errors;
  Subprocess child;
  try {
    errors = make_pipe();
    child = Subprocess(arguments, {{errors.writing.get(), STDERR_FILENO}});
  } catch (const Error& error) {
    report({.last_words = error.what()});
    return;
  }
  errors.writing.reset();
  {
    const std::lock_guard lock(mutex_);
    pid_ = child.pid();
  }
  listen(child, errors.reading.get());
  reap(std::move(child));
}

/// Reads events until the child's standard error is closed, at the latest when the child ends.
void VideoChild::listen(const Subprocess& child, int errors) {
  std::string line;
  while (true) {
    std::array<pollfd, 2> streams{pollfd{errors, POLLIN, 0}, pollfd{nudge_.fd(), POLLIN, 0}};
    poll(streams.data(), streams.size(), kPollMilliseconds);
    nudge_.drain();
    {
      const std::lock_guard lock(mutex_);
      if (kill_) child.kill();
    }
    if (streams[0].revents != 0 && !read_some(errors, line)) break;
  }
  if (!line.empty()) hear(line);
}

bool VideoChild::read_some(int errors, std::string& line) {
  std::array<char, kMostLine> buffer;
  const ssize_t n = read(errors, buffer.data(), buffer.size());
  if (n < 0) return errno == EINTR;
  for (const char c : std::string_view(buffer.data(), static_cast<size_t>(n))) {
    if (c == '\n') {
      hear(line);
      line.clear();
    } else if (line.size() < kMostLine) {
      line.push_back(c);
    }
  }
  return n > 0;
}

void VideoChild::hear(std::string_view line) {
  events_.fetch_add(1);
  const std::optional<VideoEvent> event = parse_video_event(line);
  const std::lock_guard lock(mutex_);
  if (!event) {
    // The first line that is not an event is the cause, later ones are the remedy.
    if (last_words_.empty()) last_words_ = escaped(line.substr(0, 500));
    return;
  }
  if (event->kind == VideoEvent::Kind::Position && event->time) position_ = event;
  if (event->kind == VideoEvent::Kind::Decoder) decoder_ = event;
  if (event->kind == VideoEvent::Kind::Broken) broken_.store(event->broken);
  if (event->kind != VideoEvent::Kind::Clip) return;
  missing_.fetch_add(event->missing);
  rounds_.fetch_add(1);
}

/// Reaps the child. One that closed its standard error and still runs is out of control and is
/// killed.
void VideoChild::reap(Subprocess child) {
  const ProcessEnd how = child.end();
  ChildEnd end{.exit_code = how.exit_code, .signal = how.signal, .last_words = {}};
  {
    const std::lock_guard lock(mutex_);
    end.last_words = last_words_;
    pid_ = -1;
  }
  report(std::move(end));
}

void VideoChild::report(ChildEnd end) {
  {
    const std::lock_guard lock(mutex_);
    end_ = std::move(end);
  }
  ended_.signal();
}

}  // namespace lenticule::player
