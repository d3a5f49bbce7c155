// SPDX-License-Identifier: Apache-2.0
#include "player/session/statistics_file.h"

#include <atomic>
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

/// State shared by the worker and its owner; the owner may be destroyed first.
struct StatisticsFile::Shared {
  /// Writes the newest text, after the pause that a failure has begun. A text that arrives
  /// meanwhile replaces it.
  void write_newest(const std::atomic<bool>& ending) noexcept {
    while (!ending.load() && !finishing.load() && !writes.due()) std::this_thread::sleep_for(kLook);
    try {
      const std::optional<std::string> text = [this] {
        const std::lock_guard lock(mutex);
        return std::exchange(newest, std::nullopt);
      }();
      if (!text) return;
      write_text_file(file, *text);
      writes.succeeded();
    } catch (const std::exception& error) {
      writes.failed(error.what());
    }
  }

  std::filesystem::path file;
  RetriedWrites writes{};
  std::atomic<bool> finishing{false};
  std::mutex mutex{};
  std::optional<std::string> newest{};  ///< guarded by mutex; none once it was tried
};

StatisticsFile::StatisticsFile(const std::filesystem::path& file)
    : shared_(std::make_shared<Shared>()), worker_(1) {
  shared_->file = file;
  require_writable_place(file);
}

StatisticsFile::~StatisticsFile() {
  (void)finish(kFinishTimeout);
}

void StatisticsFile::write(std::string text) {
  {
    const std::lock_guard lock(shared_->mutex);
    shared_->newest = std::move(text);
  }
  // A job that waits already will write this text.
  (void)worker_.post([shared = shared_](const auto& ending) { shared->write_newest(ending); });
}

std::string StatisticsFile::finish(std::chrono::milliseconds timeout) {
  shared_->finishing.store(true);
  if (!worker_.wait(timeout))
    return shared_->file.string() + ": cannot write: the disk does not respond";
  return shared_->writes.state().reason;
}

WriteState StatisticsFile::state() const {
  return shared_->writes.state();
}

void StatisticsFile::try_at_once() {
  shared_->writes.try_at_once();
}

}  // namespace lenticule::player
