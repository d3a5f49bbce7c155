// SPDX-License-Identifier: Apache-2.0
#include "player/session/play_service.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <sys/mman.h>
#include <systemd/sd-daemon.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cstdlib>
#include <ctime>
#include <exception>
#include <span>
#include <string_view>
#include <utility>

#include "base/file.h"
#include "base/numbers.h"

namespace lenticule::player {

ServiceManager::ServiceManager() {
  const char* const socket = std::getenv("NOTIFY_SOCKET");
  present_ = socket != nullptr && *socket != '\0';
  uint64_t microseconds = 0;
  if (present_ && sd_watchdog_enabled(0, &microseconds) > 0)
    watchdog_ = std::chrono::microseconds(microseconds);
}

void ServiceManager::notify(const std::string& text) const noexcept {
  if (present_) (void)sd_notify(0, text.c_str());
}

void ServiceManager::keep(const std::string& name, int fd) const noexcept {
  forget(name);  // the manager would keep both
  const std::string text = fmt::format("FDSTORE=1\nFDNAME={}", name);
  if (present_) (void)sd_pid_notify_with_fds(0, 0, text.c_str(), &fd, 1);
}

void ServiceManager::forget(const std::string& name) const noexcept {
  notify(fmt::format("FDSTOREREMOVE=1\nFDNAME={}", name));
}

std::vector<StoredDescriptor> take_stored_descriptors() {
  char** names = nullptr;
  const int count = sd_listen_fds_with_names(1, &names);
  std::vector<StoredDescriptor> kept;
  for (int i = 0; i < count; ++i) {
    kept.push_back({names[i], UniqueFd(SD_LISTEN_FDS_START + i)});
    std::free(names[i]);
  }
  std::free(names);
  return kept;
}

namespace {

constexpr const char* kFileName = "starts";
constexpr uint64_t kMaxFileBytes = 64 * 1024;
constexpr size_t kMaxReasonBytes = 400;
constexpr size_t kMaxStarts = 100;

std::string one_line(std::string_view text) {
  std::string line(text.substr(0, kMaxReasonBytes));
  std::replace_if(
      line.begin(), line.end(), [](char c) { return static_cast<unsigned char>(c) < ' '; }, ' ');
  return line;
}

}  // namespace

StartHistory::StartHistory(const std::filesystem::path& folder, std::chrono::seconds now)
    : file_(folder.empty() ? folder : folder / kFileName), this_{.at = now, .reason = {}} {
  if (file_.empty()) return;
  try {
    read(now);
  } catch (const std::exception&) {
    before_.clear();  // no file yet, or not readable
  }
  failed({});
}

/// Parses "SECONDS REASON" per line; skips lines that are malformed, too old or in the future.
void StartHistory::read(std::chrono::seconds now) {
  const std::vector<uint8_t> bytes = read_whole_file(file_, kMaxFileBytes);
  std::string_view text(reinterpret_cast<const char*>(bytes.data()), bytes.size());
  while (!text.empty() && before_.size() < kMaxStarts) {
    std::string_view reason = take_until(text, '\n');
    const auto at = take_number<int64_t>(reason);
    const std::chrono::seconds when(at.value_or(0));
    if (!at || when > now || when < now - kStartsRemembered) continue;
    reason.remove_prefix(std::min(reason.find_first_not_of(' '), reason.size()));
    before_.push_back({when, one_line(reason)});
  }
}

void StartHistory::failed(const std::string& reason) noexcept {
  try {
    this_.reason = one_line(reason);
    std::vector<Start> starts = before_;
    starts.push_back(this_);
    write(starts);
  } catch (const std::exception&) {
    return;  // no memory to record the reason
  }
}

void StartHistory::write(const std::vector<Start>& starts) const noexcept {
  if (file_.empty()) return;
  try {
    std::string text;
    for (const Start& start : starts)
      text += fmt::format("{} {}\n", start.at.count(), start.reason);
    write_file_atomically(file_,
                          std::span(reinterpret_cast<const uint8_t*>(text.data()), text.size()));
  } catch (const std::exception&) {
    return;  // a full or read-only disk must not prevent playing
  }
}

std::chrono::seconds time_since_boot() {
  timespec time{};
  clock_gettime(CLOCK_BOOTTIME, &time);
  return std::chrono::seconds(time.tv_sec);
}

namespace {

constexpr const char* kCardName = "lenticule-card";
constexpr const char* kStateName = "lenticule-output";

/// Creates the state file, sealed, so that the successor uses exactly the bytes that it has
/// checked. Empty on failure.
UniqueFd state_file(const display::TakeoverState& state) {
  UniqueFd file(memfd_create(kStateName, MFD_CLOEXEC | MFD_ALLOW_SEALING));
  if (!file) return {};
  const auto bytes = display::bytes_of(state);
  if (write(file.get(), bytes.data(), bytes.size()) != static_cast<ssize_t>(bytes.size()))
    return {};
  if (fcntl(file.get(), F_ADD_SEALS, F_SEAL_WRITE | F_SEAL_GROW | F_SEAL_SHRINK | F_SEAL_SEAL) != 0)
    return {};
  return file;
}

std::optional<display::TakeoverState> read_state(int file) {
  // One extra byte detects a file that is too long.
  std::array<uint8_t, sizeof(display::TakeoverState) + 1> bytes{};
  const ssize_t size = pread(file, bytes.data(), bytes.size(), 0);
  if (size < 0) return std::nullopt;
  return display::parse_takeover_state(std::span(bytes.data(), static_cast<size_t>(size)));
}

}  // namespace

void store_output(const ServiceManager& manager, const display::KmsDisplay& display) {
  if (!manager.present()) return;
  const UniqueFd state = state_file(display.takeover_state());
  if (!state) return forget_output(manager);
  manager.keep(kCardName, display.card_fd());
  manager.keep(kStateName, state.get());
}

void forget_output(const ServiceManager& manager) {
  manager.forget(kCardName);
  manager.forget(kStateName);
}

std::shared_ptr<display::PreviousOutput> stored_output(std::vector<StoredDescriptor> descriptors) {
  auto output = std::make_shared<display::PreviousOutput>();
  std::optional<display::TakeoverState> state;
  for (StoredDescriptor& descriptor : descriptors) {
    if (descriptor.name == kCardName) output->card = std::move(descriptor.fd);
    if (descriptor.name == kStateName) state = read_state(descriptor.fd.get());
  }
  if (!output->card || !state) return nullptr;
  output->state = *state;
  return output;
}

ProgressSample progress_sample(const PlayReport& report, const display::KmsStatistics* kms) {
  StageDelays own = report.delays;
  if (own.source_waits_for_others) own.source = 0;
  ProgressSample sample{.flips = report.pace.shown,
                        .vblanks = report.wake.count,
                        .failures = report.flip_timeouts + report.busy,
                        .panel_away = report.off,
                        .stalled = !stalled_stage(own).empty()};
  if (kms == nullptr) return sample;
  sample.flips = kms->flips;
  sample.failures += kms->busy + kms->refused + kms->flip_timeouts;
  sample.panel_away |= kms->panel != display::PanelState::Showing;
  return sample;
}

std::string status_text(const PlayReport& report, const display::KmsStatistics* kms,
                        const display::ExactnessReport* exactness) {
  std::string text;
  if (exactness != nullptr) text = exactness->summary() + "; ";
  text += fmt::format("{} frames shown, {} underruns, {} missed vblanks", report.pace.shown,
                      report.pace.underruns, report.pace.missed);
  if (report.off) text += ", output off";
  if (kms != nullptr) text += fmt::format(", panel {}", panel_state_name(kms->panel));
  return text + "; " + report.display;
}

PlayService::PlayService(const ServiceManager& manager, const display::KmsDisplay* display)
    : manager_(manager), display_(display), last_ping_(std::chrono::steady_clock::now()) {
  store_again();
}

void PlayService::report(const PlayReport& report) {
  if (!manager_.present()) return;
  std::optional<display::KmsStatistics> kms;
  std::optional<display::ExactnessReport> exactness;
  if (display_ != nullptr) {
    kms = display_->statistics();
    exactness = display_->exactness();
  }
  const display::KmsStatistics* const statistics = kms ? &*kms : nullptr;
  std::string text = status_text(report, statistics, exactness ? &*exactness : nullptr);
  if (!problem_.empty()) text = "test card shown: " + problem_ + "; " + text;
  if (!warning_.empty()) text += "; " + warning_;
  if (!ready_ && report.first_frame_ms > 0) {
    ready_ = true;
    manager_.ready(text);
  } else if (ready_) {
    manager_.status(text);
  }

  if (!manager_.watchdog()) return;
  // Often enough for the watchdog, and rarely enough that a failing display is noticed between two
  // pings.
  const auto now = std::chrono::steady_clock::now();
  if (now - last_ping_ < *manager_.watchdog() * 2 / 5) return;
  last_ping_ = now;
  if (watchdog_.should_ping(progress_sample(report, statistics))) manager_.ping();
}

}  // namespace lenticule::player
