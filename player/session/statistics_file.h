// SPDX-License-Identifier: Apache-2.0
// StatisticsFile is the file of --stats, replaced about every second by its own thread, so that a
// full, missing or hanging disk cannot delay the playback threads.
#pragma once

#include <atomic>
#include <chrono>
#include <exception>
#include <filesystem>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <thread>
#include <utility>

#include "base/file.h"
#include "base/retried_writes.h"
#include "player/process/detached_worker.h"

namespace lenticule::player {

/// StatisticsFile keeps a file at the newest text that it was given. Thread safety: one thread.
class StatisticsFile {
 public:
  /// Throws Error(Failed) for a file that can never be written (require_writable_place).
  explicit StatisticsFile(const std::filesystem::path& file)
      : shared_(std::make_shared<Shared>()), worker_(1) {
    shared_->file = file;
    require_writable_place(file);
  }
  /// Leaves the thread running if a hanging disk blocks it.
  ~StatisticsFile() { (void)finish(kFinishTimeout); }

  /// Returns at once. Replaces a text that is not written yet.
  void write(std::string text) {
    {
      const std::lock_guard lock(shared_->mutex);
      shared_->newest = std::move(text);
    }
    // A job that waits already will write this text.
    (void)worker_.post([shared = shared_](const auto& ending) { shared->write_newest(ending); });
  }
  /// Waits at most `timeout` until the newest text was tried, without waiting for the pause after
  /// a failure. Returns an empty string if the text is in the file, else the reason.
  [[nodiscard]] std::string finish(std::chrono::milliseconds timeout) {
    shared_->finishing.store(true);
    if (!worker_.wait(timeout))
      return shared_->file.string() + ": cannot write: the disk does not respond";
    return shared_->writes.state().reason;
  }
  [[nodiscard]] WriteState state() const { return shared_->writes.state(); }
  void try_at_once() { shared_->writes.try_at_once(); }

 private:
  /// Timeout for a disk that hangs while the player ends.
  static constexpr std::chrono::seconds kFinishTimeout{2};

  /// Interval at which the end of a pause is checked.
  static constexpr std::chrono::milliseconds kLook{100};

  /// State shared by the worker and its owner; the owner may be destroyed first.
  struct Shared {
    /// Writes the newest text, after the pause that a failure has begun. A text that arrives
    /// meanwhile replaces it.
    void write_newest(const std::atomic<bool>& ending) noexcept {
      while (!ending.load() && !finishing.load() && !writes.due())
        std::this_thread::sleep_for(kLook);
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
  std::shared_ptr<Shared> shared_;
  DetachedWorker worker_;
};

}  // namespace lenticule::player
