// SPDX-License-Identifier: Apache-2.0
// Runs systemd's journal for a test, and programs that write to it.
#pragma once

#include <unistd.h>

#include <filesystem>
#include <memory>
#include <string>
#include <vector>

#include "tests/support/process.h"

namespace lenticule::test {

/// PrivateJournal is a systemd-journald in a mount namespace of its own, whose /run is empty. Its
/// socket therefore has the path to which libsystemd sends, and the machine's journal, if there is
/// one, is not involved. Journal files are in `folder`, where all processes see them. An ordinary
/// user needs user namespaces.
class PrivateJournal {
 public:
  explicit PrivateJournal(const std::string& folder) : folder_(folder) {
    std::filesystem::create_directories(folder);
    const std::string script =
        "mount -t tmpfs none /run && mkdir -p /run/systemd/journal /run/systemd/journald.conf.d "
        "/run/log/journal && mount --bind \"$1\" /run/log/journal && "
        "printf '[Journal]\\nReadKMsg=no\\nAudit=no\\nStorage=volatile\\nRateLimitBurst=0\\n' "
        "> /run/systemd/journald.conf.d/test.conf && exec /lib/systemd/systemd-journald";
    daemon_ = std::make_unique<BackgroundProcess>(std::vector<std::string>{
        "/usr/bin/unshare", is_root() ? "-m" : "-rm", "/bin/sh", "-c", script, "sh", folder});
  }

  /// Returns true once the journal can be written.
  [[nodiscard]] bool is_ready() const {
    return run_process(inside({"/bin/sh", "-c", "test -S /run/systemd/journal/socket"}))
               .exit_code == 0;
  }
  /// Returns the command that runs `command` where its journal is this one.
  [[nodiscard]] std::vector<std::string> inside(const std::vector<std::string>& command) const {
    std::vector<std::string> words = {"/usr/bin/nsenter", "-m", "-t",
                                      std::to_string(daemon_->pid())};
    if (!is_root()) words.insert(words.end(), {"-U", "--preserve-credentials"});
    words.insert(words.end(), command.begin(), command.end());
    return words;
  }
  /// Returns the folder of the journal files; empty until there is one.
  [[nodiscard]] std::string folder() const {
    for (const auto& entry : std::filesystem::directory_iterator(folder_))
      if (entry.is_directory()) return entry.path().string();
    return {};
  }

 private:
  [[nodiscard]] static bool is_root() { return ::geteuid() == 0; }

  const std::string folder_;
  std::unique_ptr<BackgroundProcess> daemon_;
};

}  // namespace lenticule::test
