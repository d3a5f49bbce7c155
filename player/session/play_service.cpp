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

}  // namespace lenticule::player
