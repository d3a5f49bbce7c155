// SPDX-License-Identifier: Apache-2.0
// Packets of SOCK_SEQPACKET sockets, each with at most one descriptor, and the texts in them.
#pragma once

#include <sys/socket.h>
#include <sys/types.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstddef>
#include <cstring>
#include <string>

#include "base/unique_fd.h"

namespace lenticule {

/// Room for the control message of one descriptor.
using DescriptorControl = std::array<char, CMSG_SPACE(sizeof(int))>;

/// Sends a packet, with the descriptor if there is one. `flags` are those of sendmsg(2). Returns
/// false if it cannot be sent, for example because the other side is gone.
[[nodiscard]] inline bool send_packet(int socket, const void* bytes, size_t count,
                                      int descriptor = -1, int flags = 0) noexcept {
  iovec part{.iov_base = const_cast<void*>(bytes), .iov_len = count};
  alignas(cmsghdr) DescriptorControl control{};
  msghdr header{};
  header.msg_iov = &part;
  header.msg_iovlen = 1;
  if (descriptor >= 0) {
    header.msg_control = control.data();
    header.msg_controllen = control.size();
    cmsghdr* const passed = CMSG_FIRSTHDR(&header);
    passed->cmsg_level = SOL_SOCKET;
    passed->cmsg_type = SCM_RIGHTS;
    passed->cmsg_len = CMSG_LEN(sizeof descriptor);
    std::memcpy(CMSG_DATA(passed), &descriptor, sizeof descriptor);
  }
  ssize_t n = 0;
  do {
    n = ::sendmsg(socket, &header, flags | MSG_NOSIGNAL);
  } while (n < 0 && errno == EINTR);
  return n == static_cast<ssize_t>(count);
}

/// Receives a packet. `flags` are those of recvmsg(2). Returns the packet's size, which may exceed
/// `count`, 0 if the other side is gone, or -1 with errno. Stores its descriptor; without a place
/// for it, the kernel closes it.
[[nodiscard]] inline ssize_t receive_packet(int socket, void* bytes, size_t count,
                                            UniqueFd* descriptor, int flags = 0) noexcept {
  iovec part{.iov_base = bytes, .iov_len = count};
  alignas(cmsghdr) DescriptorControl control{};
  msghdr header{};
  header.msg_iov = &part;
  header.msg_iovlen = 1;
  if (descriptor != nullptr) {
    header.msg_control = control.data();
    // Not CMSG_SPACE, whose padding has room for a second descriptor that nothing would close.
    header.msg_controllen = CMSG_LEN(sizeof(int));
  }
  ssize_t n = 0;
  do {
    n = ::recvmsg(socket, &header, flags | MSG_CMSG_CLOEXEC | MSG_TRUNC);
  } while (n < 0 && errno == EINTR);
  const cmsghdr* const passed = n >= 0 ? CMSG_FIRSTHDR(&header) : nullptr;
  if (passed != nullptr && passed->cmsg_level == SOL_SOCKET && passed->cmsg_type == SCM_RIGHTS) {
    int received = -1;
    std::memcpy(&received, CMSG_DATA(passed), sizeof received);
    *descriptor = UniqueFd(received);
  }
  return n;
}

/// Writes a text that ends with a zero, shortened to its place.
template <size_t Size>
void set_text(std::array<char, Size>& to, const std::string& text) {
  to = {};
  std::copy_n(text.begin(), std::min(text.size(), Size - 1), to.begin());
}

template <size_t Size>
std::string text_of(const std::array<char, Size>& from) {
  return {from.begin(), std::find(from.begin(), from.end(), '\0')};
}

}  // namespace lenticule
