// SPDX-License-Identifier: Apache-2.0
// ListenSocket is the Unix socket on which a player listens: a file with mode 0600, or 0660 for a
// group, that is removed when the player exits.
#pragma once

#include <sys/socket.h>
#include <sys/stat.h>

#include <filesystem>
#include <optional>

#include "base/unique_fd.h"

namespace lenticule::frames {

struct ListenOptions {
  int type = SOCK_SEQPACKET;
  /// Group whose members may connect in addition to the owner.
  std::optional<gid_t> group = std::nullopt;
};

class ListenSocket {
 public:
  /// Replaces the socket file of a player that has exited; the new one appears when clients can
  /// connect. Throws Error(Device) when a live player listens there, Error(Usage) when the path is
  /// too long or names something other than a socket, Error(Failed) otherwise.
  explicit ListenSocket(std::filesystem::path path, const ListenOptions& options = {});
  ~ListenSocket();
  ListenSocket(const ListenSocket&) = delete;
  ListenSocket& operator=(const ListenSocket&) = delete;

  [[nodiscard]] int fd() const { return fd_.get(); }
  /// Returns the next waiting connection; empty if there is none. Never blocks.
  [[nodiscard]] UniqueFd accept() const noexcept;

 private:
  std::filesystem::path path_;
  UniqueFd fd_;
  dev_t device_ = 0;
  ino_t inode_ = 0;
};

}  // namespace lenticule::frames
