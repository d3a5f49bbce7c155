// SPDX-License-Identifier: Apache-2.0
// Packets of SOCK_SEQPACKET sockets, each with at most one descriptor.
#pragma once

#include <sys/types.h>

#include <cstddef>

#include "base/unique_fd.h"

namespace lenticule {

/// Sends a packet, with the descriptor if there is one. `flags` are those of sendmsg(2). Returns
/// false if it cannot be sent, for example because the other side is gone.
[[nodiscard]] bool send_packet(int socket, const void* bytes, size_t count, int descriptor = -1,
                               int flags = 0) noexcept;

/// Receives a packet. `flags` are those of recvmsg(2). Returns the packet's size, which may exceed
/// `count`, 0 if the other side is gone, or -1 with errno. Stores its descriptor; without a place
/// for it, the kernel closes it.
[[nodiscard]] ssize_t receive_packet(int socket, void* bytes, size_t count, UniqueFd* descriptor,
                                     int flags = 0) noexcept;

}  // namespace lenticule
