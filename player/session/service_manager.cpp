// SPDX-License-Identifier: Apache-2.0
#include "player/session/service_manager.h"

#include <fmt/format.h>
#include <systemd/sd-daemon.h>

#include <cstdlib>

#include "base/text.h"

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

// A message consists of lines KEY=value. Escaping keeps a text from adding a line.
void ServiceManager::status(const std::string& text) const noexcept {
  notify("STATUS=" + escaped(text));
}

void ServiceManager::ready(const std::string& text) const noexcept {
  notify("READY=1\nSTATUS=" + escaped(text));
}

void ServiceManager::stopping(const std::string& text) const noexcept {
  notify("STOPPING=1\nSTATUS=" + escaped(text));
}

void ServiceManager::ping() const noexcept {
  notify("WATCHDOG=1");
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

}  // namespace lenticule::player
