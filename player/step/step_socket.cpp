// SPDX-License-Identifier: Apache-2.0
#include "player/step/step_socket.h"

#include <fmt/format.h>
#include <netdb.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>

#include "base/error.h"
#include "base/numbers.h"
#include "base/unix_address.h"

namespace lenticule::player {
namespace {

StepEndpoint endpoint_of(const sockaddr* address, socklen_t bytes) {
  StepEndpoint endpoint;
  std::memcpy(&endpoint.address, address, bytes);
  endpoint.bytes = bytes;
  return endpoint;
}

[[noreturn]] void refuse_address(const std::string& text) {
  throw Error(ErrorKind::Usage, fmt::format("--step-address '{}': not an address", text),
              "write ADDRESS:PORT with a numeric address, such as 192.168.1.20:7070 or "
              "[fd00::20]:7070, or the path of a Unix socket, such as /run/lenticule/step.sock");
}

const sockaddr* generic(const StepEndpoint& endpoint) {
  return reinterpret_cast<const sockaddr*>(&endpoint.address);
}

UniqueFd datagram_socket(int family) {
  UniqueFd fd(::socket(family, SOCK_DGRAM | SOCK_CLOEXEC | SOCK_NONBLOCK, 0));
  if (!fd)
    throw Error(ErrorKind::Failed, fmt::format("--step: no socket: {}", std::strerror(errno)));
  return fd;
}

void bind_to(const UniqueFd& fd, const StepEndpoint& endpoint, const std::string& text) {
  if (::bind(fd.get(), generic(endpoint), endpoint.bytes) == 0) return;
  const bool taken = errno == EADDRINUSE;
  throw Error(ErrorKind::Device,
              fmt::format("--step-address {}: cannot be bound: {}", text, std::strerror(errno)),
              taken ? "stop the other leader, or use another port"
                    : "a leader needs an address of its own machine, or 0.0.0.0 for all of them");
}

/// Lets the kernel choose the address of a Unix socket.
void bind_to_any_name(const UniqueFd& fd) {
  sockaddr_un any{};
  any.sun_family = AF_UNIX;
  if (::bind(fd.get(), reinterpret_cast<const sockaddr*>(&any), sizeof any.sun_family) != 0)
    throw Error(ErrorKind::Failed,
                fmt::format("--step: the socket gets no name: {}", std::strerror(errno)));
}

/// Returns true if the kernel states that this user or root sent the datagram.
bool sent_by_us(const msghdr& header) {
  for (cmsghdr* part = CMSG_FIRSTHDR(&header); part != nullptr;
       part = CMSG_NXTHDR(const_cast<msghdr*>(&header), part)) {
    if (part->cmsg_level != SOL_SOCKET || part->cmsg_type != SCM_CREDENTIALS) continue;
    ucred sender{};
    std::memcpy(&sender, CMSG_DATA(part), sizeof sender);
    return sender.uid == ::geteuid() || sender.uid == 0;
  }
  return false;
}

}  // namespace

StepAddress parse_step_address(const std::string& text) {
  if (text.find('/') != std::string::npos) {
    const UnixAddress address = unix_address(text);
    return {.text = text, .is_unix = true, .endpoint = endpoint_of(address.get(), address.bytes)};
  }
  const size_t colon = text.rfind(':');
  if (colon == std::string::npos || colon == 0) refuse_address(text);
  std::string host = text.substr(0, colon);
  const std::string port = text.substr(colon + 1);
  if (host.size() > 2 && host.front() == '[' && host.back() == ']')
    host = host.substr(1, host.size() - 2);
  else if (host.find(':') != std::string::npos)
    refuse_address(text);
  const auto number = number_from<uint16_t>(port);
  if (!number || *number == 0) refuse_address(text);
  addrinfo hints{};
  hints.ai_flags = AI_NUMERICHOST | AI_NUMERICSERV;
  hints.ai_socktype = SOCK_DGRAM;
  addrinfo* found = nullptr;
  if (::getaddrinfo(host.c_str(), port.c_str(), &hints, &found) != 0) refuse_address(text);
  StepAddress address{.text = text, .endpoint = endpoint_of(found->ai_addr, found->ai_addrlen)};
  ::freeaddrinfo(found);
  return address;
}

StepSocket::StepSocket(const StepAddress& address, bool leader) : is_unix_(address.is_unix) {
  if (is_unix_ && leader) {
    fd_ = listening_.emplace(address.text, frames::ListenOptions{.type = SOCK_DGRAM}).fd();
  } else {
    own_ = datagram_socket(address.endpoint.address.ss_family);
    fd_ = own_.get();
    if (leader) bind_to(own_, address.endpoint, address.text);
    if (is_unix_) bind_to_any_name(own_);
  }
  const int on = 1;
  if (is_unix_ && ::setsockopt(fd_, SOL_SOCKET, SO_PASSCRED, &on, sizeof on) != 0)
    throw Error(ErrorKind::Failed,
                fmt::format("--step: the kernel names no senders: {}", std::strerror(errno)));
}

std::optional<StepSocket::Datagram> StepSocket::receive() noexcept {
  while (true) {
    Datagram datagram;
    iovec part{.iov_base = buffer_.data(), .iov_len = buffer_.size()};
    alignas(cmsghdr) std::array<char, CMSG_SPACE(sizeof(ucred))> control{};
    msghdr header{};
    header.msg_name = &datagram.from.address;
    header.msg_namelen = sizeof datagram.from.address;
    header.msg_iov = &part;
    header.msg_iovlen = 1;
    header.msg_control = control.data();
    header.msg_controllen = control.size();
    const ssize_t bytes = ::recvmsg(fd_, &header, MSG_DONTWAIT);
    // A follower whose leader is gone gets the error of its last datagram here.
    if (bytes < 0 && (errno == EINTR || errno == ECONNREFUSED)) continue;
    if (bytes < 0) return std::nullopt;
    if (is_unix_ && !sent_by_us(header)) continue;
    datagram.from.bytes = header.msg_namelen;
    datagram.bytes = std::span(buffer_).first(static_cast<size_t>(bytes));
    return datagram;
  }
}

void StepSocket::send(const StepEndpoint& to, std::span<const uint8_t> bytes) const noexcept {
  (void)::sendto(fd_, bytes.data(), bytes.size(), MSG_DONTWAIT | MSG_NOSIGNAL, generic(to),
                 to.bytes);
}

}  // namespace lenticule::player
