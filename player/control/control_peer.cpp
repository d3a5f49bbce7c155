// SPDX-License-Identifier: Apache-2.0
#include "player/control/control_peer.h"

#include <fmt/format.h>
#include <grp.h>
#include <sys/socket.h>

#include <algorithm>
#include <array>

#include "base/error.h"

namespace lenticule::player {

ControlRights rights_of(const ControlPeer& peer, const ControlPolicy& policy) {
  if (peer.uid == policy.owner || peer.uid == 0) return ControlRights::Everything;
  const bool member = policy.group && std::find(peer.groups.begin(), peer.groups.end(),
                                                *policy.group) != peer.groups.end();
  return member ? ControlRights::Steer : ControlRights::None;
}

std::optional<ControlPeer> peer_of(int socket) {
  ucred credentials{};
  socklen_t size = sizeof credentials;
  if (::getsockopt(socket, SOL_SOCKET, SO_PEERCRED, &credentials, &size) != 0) return std::nullopt;
  ControlPeer peer{.uid = credentials.uid, .groups = {credentials.gid}};
  std::array<gid_t, 1024> more{};
  size = sizeof more;
  if (::getsockopt(socket, SOL_SOCKET, SO_PEERGROUPS, more.data(), &size) == 0)
    peer.groups.insert(peer.groups.end(), more.begin(),
                       more.begin() + static_cast<ptrdiff_t>(size / sizeof(gid_t)));
  return peer;
}

gid_t group_named(const std::string& name) {
  std::array<char, 16384> strings{};
  group entry{};
  group* found = nullptr;
  (void)::getgrnam_r(name.c_str(), &entry, strings.data(), strings.size(), &found);
  if (found != nullptr) return found->gr_gid;
  throw Error(ErrorKind::Usage, fmt::format("--control-group '{}': no such group", name),
              "getent group lists them");
}

}  // namespace lenticule::player
