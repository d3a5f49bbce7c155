// SPDX-License-Identifier: Apache-2.0
// UnixAddress is the address of a Unix socket's file, for connect() and bind().
#pragma once

#include <sys/socket.h>
#include <sys/un.h>

#include <filesystem>

namespace lenticule {

struct UnixAddress {
  sockaddr_un address = {};
  socklen_t bytes = 0;

  [[nodiscard]] const sockaddr* get() const { return reinterpret_cast<const sockaddr*>(&address); }
};

/// Throws Error(Usage) for an empty path or a path longer than the kernel's limit (107 bytes).
[[nodiscard]] UnixAddress unix_address(const std::filesystem::path& path);

}  // namespace lenticule
