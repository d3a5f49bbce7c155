// SPDX-License-Identifier: Apache-2.0
#include "player/session/play_outputs.h"

#include <fmt/format.h>

#include <condition_variable>
#include <exception>
#include <mutex>
#include <optional>
#include <thread>
#include <utility>

#include "base/file.h"
#include "base/json_output.h"
#include "base/print.h"
#include "display/open/open_display.h"
#include "optics/trim.h"

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

using nlohmann::ordered_json;

PlayOutputs::PlayOutputs(const PlayFlags& flags, PlayPlan& plan) : flags_(flags), plan_(plan) {
  if (!flags.stats.empty()) statistics_.emplace(flags.stats);
}

void PlayOutputs::open_recording() {
  if (!flags_.record.empty()) plan_.display.recorder = display::open_recorder(flags_.record);
}

std::vector<PlayOutputs::File> PlayOutputs::files() const {
  std::vector<File> files;
  if (statistics_) files.push_back({flags_.stats, statistics_->state()});
  if (!flags_.record.empty() && plan_.display.recorder)
    files.push_back({flags_.record, plan_.display.recorder->writes().state()});
  if (plan_.trim)
    files.push_back({optics::trim_file_of(plan_.rig_file).string(), plan_.trim->writes().state()});
  return files;
}

void PlayOutputs::write_statistics(const ordered_json& statistics) {
  if (statistics_) statistics_->write(json_text(statistics, 2) + "\n");
}

void PlayOutputs::describe_problems(ordered_json& statistics) const {
  statistics["write_trouble"] = ordered_json::array();
  for (const File& file : files())
    if (file.state.failures > 0)
      statistics["write_trouble"].push_back(
          {{"object", file.name}, {"cause", file.state.reason}, {"failures", file.state.failures}});
}

std::string PlayOutputs::report_problems() {
  std::string all;
  for (const File& file : files()) {
    const std::string& reason = file.state.reason;
    if (!reason.empty()) {
      const bool names_it = reason.find(": ") != std::string::npos;
      const std::string what = names_it ? reason : fmt::format("{}: {}", file.name, reason);
      all += all.empty() ? what : ", " + what;
      if (cannot_write_.insert(file.name).second)
        say("{}; playback continues, and the player tries again\n", what);
    } else if (cannot_write_.erase(file.name) > 0) {
      say("{}: written again after {} failures\n", file.name, file.state.failures);
    }
  }
  return all;
}

void PlayOutputs::try_at_once() {
  if (statistics_) statistics_->try_at_once();
  if (plan_.display.recorder) plan_.display.recorder->writes().try_at_once();
  if (plan_.trim) plan_.trim->writes().try_at_once();
}

void PlayOutputs::save_trim_again() {
  if (plan_.trim) plan_.trim->save_again();
}

ordered_json PlayOutputs::finish_recording() {
  if (!plan_.display.recorder) return nullptr;
  display::ScanoutRecorder& recorder = *plan_.display.recorder;
  try {
    recorder.finish();
  } catch (const Error& error) {
    incomplete_ = error;
  }
  const uint64_t skipped = recorder.skipped();
  if (skipped > 0)
    say("{}: {} displayed frames came too fast and are not recorded\n"
        "  record checksums, play fewer frames per second, or use --clock simulated\n",
        flags_.record, skipped);
  return {{"place", flags_.record}, {"skipped", skipped}, {"lost", recorder.lost()}};
}

void PlayOutputs::finish_statistics() {
  constexpr auto kLongestFinish = std::chrono::seconds(10);
  if (!statistics_) return;
  const std::string why = statistics_->finish(kLongestFinish);
  if (!why.empty() && !incomplete_) incomplete_.emplace(ErrorKind::Failed, why);
}

}  // namespace lenticule::player
