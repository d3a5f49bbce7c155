// SPDX-License-Identifier: Apache-2.0
// Opens the sockets on which the server listens: TCP, Unix, or passed by the service manager.
#pragma once

#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

#include "base/unique_fd.h"

namespace lenticule::web {

struct Listener {
  UniqueFd fd;
  std::string name;       ///< "127.0.0.1:8420" or the path of the socket
  bool is_unix = false;   ///< requests come from a reverse proxy of this machine
  bool is_local = false;  ///< only this machine can connect
};

/// Returns the addresses by which clients reach the listener: for one that accepts connections at
/// every address of the machine, those of its network interfaces.
[[nodiscard]] std::vector<std::string> reachable_names(const Listener& listener);

/// Address to listen on. Names are not looked up.
struct ListenAddress {
  std::string host;  ///< numeric, without brackets
  uint16_t port = 0;
};
/// Parses "127.0.0.1:8420" or "[::1]:8420". Throws Error(Usage).
[[nodiscard]] ListenAddress parse_listen_address(const std::string& text);

/// Listens on an address. Throws Error(Usage) if other machines could connect and `lan` is false,
/// Error(Device) if the address is taken.
[[nodiscard]] Listener listen_tcp(const ListenAddress& address, bool lan);
/// Listens on a Unix socket with mode 0660; replaces the socket of a server that has exited.
[[nodiscard]] Listener listen_unix(const std::filesystem::path& path);
/// Returns the sockets that the service manager passed; empty if there are none. Throws
/// Error(Usage) if other machines could connect to one and `lan` is false.
[[nodiscard]] std::vector<Listener> passed_listeners(bool lan);

}  // namespace lenticule::web
