// SPDX-License-Identifier: Apache-2.0
#include "base/retried_writes.h"

#include <sys/stat.h>

#include <algorithm>
#include <cerrno>
#include <exception>

#include "base/error.h"
#include "base/file.h"

namespace lenticule {

bool RetriedWrites::due(Clock::time_point now) const noexcept {
  const std::lock_guard lock(mutex_);
  return state_.reason.empty() || now >= again_;
}

void RetriedWrites::failed(const char* reason, Clock::time_point now) noexcept {
  const std::lock_guard lock(mutex_);
  ++state_.failures;
  again_ = now + pause_;
  pause_ = std::min(2 * pause_, kLongestPause);
  try {
    state_.reason = *reason != '\0' ? reason : "cannot write";
  } catch (const std::exception&) {
    state_.reason = "no memory";  // short enough for the small-string buffer, so it cannot throw
  }
}

void RetriedWrites::succeeded() noexcept {
  const std::lock_guard lock(mutex_);
  state_.reason.clear();
  pause_ = kFirstPause;
}

void RetriedWrites::try_at_once() noexcept {
  const std::lock_guard lock(mutex_);
  again_ = {};
}

WriteState RetriedWrites::state() const {
  const std::lock_guard lock(mutex_);
  return state_;
}

void require_writable_place(const std::filesystem::path& file) {
  const std::filesystem::path folder = file.has_parent_path() ? file.parent_path() : ".";
  struct stat status {};
  const bool found = ::stat(folder.c_str(), &status) == 0;
  if (!found && (errno == ENOENT || errno == ENOTDIR))
    throw Error(ErrorKind::Failed, file.string() + ": cannot write: its folder does not exist",
                "create the folder first");
  if (found && !S_ISDIR(status.st_mode))
    throw Error(ErrorKind::Failed,
                file.string() + ": cannot write: " + folder.string() + " is not a folder",
                "choose a file in an existing folder");
  if (::stat(file.c_str(), &status) == 0 && !S_ISREG(status.st_mode))
    throw Error(ErrorKind::Failed,
                file.string() + ": cannot write: it is " + kind_of_file(status.st_mode) +
                    ", not a regular file",
                "use another name");
}

}  // namespace lenticule
