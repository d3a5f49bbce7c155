// SPDX-License-Identifier: Apache-2.0
#include "player/session/statistics_file.h"

#include <condition_variable>
#include <exception>
#include <mutex>
#include <optional>
#include <thread>
#include <utility>

#include "base/file.h"

namespace lenticule::player {
namespace {

/// Timeout for a disk that hangs while the player ends.
constexpr std::chrono::seconds kFinishTimeout{2};
/// Interval at which the end of a pause is checked.
constexpr std::chrono::milliseconds kLook{100};

}  // namespace

/// State shared by the thread and its owner; the owner may be destroyed first.
struct StatisticsFile::Shared {
  explicit Shared(std::filesystem::path name) : file(std::move(name)) {}

  void work() noexcept;
  void write_to_disk(const std::string& text) noexcept;

  const std::filesystem::path file;
  RetriedWrites writes;
  std::mutex mutex;  ///< guards the members below
  std::condition_variable changed;
  std::optional<std::string> newest;  ///< not tried yet, or failed
  bool ending = false;
  bool over = false;  ///< the thread has ended
};

void StatisticsFile::Shared::write_to_disk(const std::string& text) noexcept {
  try {
    write_text_file(file, text);
    writes.succeeded();
  } catch (const std::exception& error) {
    writes.failed(error.what());
  }
}

/// Writes the texts. A text that arrives during the pause after a failure is written when the pause
/// ends, unless a newer one replaces it.
void StatisticsFile::Shared::work() noexcept {
  std::unique_lock lock(mutex);
  while (true) {
    if (!newest && ending) break;
    if (!newest) {
      changed.wait(lock);
    } else if (!ending && !writes.due()) {
      changed.wait_for(lock, kLook);
    } else {
      const std::string text = std::move(*newest);
      newest.reset();
      lock.unlock();
      write_to_disk(text);
      lock.lock();
    }
  }
  over = true;
  changed.notify_all();
}

StatisticsFile::StatisticsFile(const std::filesystem::path& file)
    : shared_(std::make_shared<Shared>(file)) {
  require_writable_place(file);
  std::thread([shared = shared_] { shared->work(); }).detach();
}

StatisticsFile::~StatisticsFile() {
  (void)finish(kFinishTimeout);
}

void StatisticsFile::write(std::string text) {
  {
    const std::lock_guard lock(shared_->mutex);
    shared_->newest = std::move(text);
  }
  shared_->changed.notify_all();
}

std::string StatisticsFile::finish(std::chrono::milliseconds timeout) {
  std::unique_lock lock(shared_->mutex);
  shared_->ending = true;
  shared_->changed.notify_all();
  const bool over = shared_->changed.wait_for(lock, timeout, [this] { return shared_->over; });
  if (!over) return shared_->file.string() + ": cannot write: the disk does not respond";
  return shared_->writes.state().reason;
}

WriteState StatisticsFile::state() const {
  return shared_->writes.state();
}

void StatisticsFile::try_at_once() {
  shared_->writes.try_at_once();
}

}  // namespace lenticule::player
