// SPDX-License-Identifier: Apache-2.0
// UnixAddress is the address of a Unix socket's file, for connect() and bind().
#pragma once

#include <sys/socket.h>
#include <sys/un.h>

#include <cstring>
#include <filesystem>

#include "base/error.h"

namespace lenticule {

struct UnixAddress {
  sockaddr_un address = {};
  socklen_t bytes = 0;

  [[nodiscard]] const sockaddr* get() const { return reinterpret_cast<const sockaddr*>(&address); }
};

/// Throws Error(Usage) for an empty path or a path longer than the kernel's limit (107 bytes).
[[nodiscard]] inline UnixAddress unix_address(const std::filesystem::path& path) {
  const std::string& text = path.native();
  UnixAddress result;
  if (text.empty()) throw Error(ErrorKind::Usage, "the path of the socket is empty");
  if (text.size() >= sizeof result.address.sun_path)
    throw Error(ErrorKind::Usage,
                text + ": too long for a socket (" + std::to_string(text.size()) + " bytes)",
                "use a path of at most " + std::to_string(sizeof result.address.sun_path - 1) +
                    " bytes, for example below /run");
  result.address.sun_family = AF_UNIX;
  std::memcpy(result.address.sun_path, text.data(), text.size());
  result.bytes = static_cast<socklen_t>(offsetof(sockaddr_un, sun_path) + text.size() + 1);
  return result;
}

}  // namespace lenticule
