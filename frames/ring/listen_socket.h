// SPDX-License-Identifier: Apache-2.0
// The Unix socket that a player listens on: a file with mode 0600, or 0660 for a group, that
// goes away with the player.
#pragma once

#include <sys/socket.h>
#include <sys/stat.h>
#include <sys/un.h>

#include <filesystem>
#include <optional>

#include "base/unique_fd.h"

namespace lenticule::frames {

struct ListenOptions {
  int type = SOCK_SEQPACKET;
  /// Who beside the owner may connect: members of this group.
  std::optional<gid_t> group = std::nullopt;
};

class ListenSocket {
 public:
  /// Replaces the file of a player that is gone. Throws Error(Device) when a live one listens
  /// there, Error(Usage) when the path is too long or something else lies there, Error(Failed)
  /// otherwise.
  explicit ListenSocket(std::filesystem::path path, const ListenOptions& options = {});
  ~ListenSocket();
  ListenSocket(const ListenSocket&) = delete;
  ListenSocket& operator=(const ListenSocket&) = delete;

  [[nodiscard]] int fd() const { return fd_.get(); }
  /// The next connection that waits; empty if none does. Never blocks.
  [[nodiscard]] UniqueFd accept() const noexcept;

 private:
  std::filesystem::path path_;
  UniqueFd fd_;
  dev_t device_ = 0;
  ino_t inode_ = 0;
};

struct UnixAddress {
  sockaddr_un address = {};
  socklen_t bytes = 0;

  [[nodiscard]] const sockaddr* get() const { return reinterpret_cast<const sockaddr*>(&address); }
};

/// Throws Error(Usage) for an empty path or one longer than the kernel takes (107 bytes).
[[nodiscard]] UnixAddress unix_address(const std::filesystem::path& path);

}  // namespace lenticule::frames
