// SPDX-License-Identifier: Apache-2.0
// ControlPeer identifies the process at the other end of a Unix socket; ControlPolicy decides
// whether that process may control a player.
#pragma once

#include <sys/types.h>

#include <functional>
#include <optional>
#include <string>
#include <vector>

namespace lenticule::player {

struct ControlPeer {
  uid_t uid = static_cast<uid_t>(-1);
  std::vector<gid_t> groups{};
};

struct ControlPolicy {
  uid_t owner = 0;
  std::optional<gid_t> group{};
};

enum class ControlRights {
  None,
  Steer,  ///< everything except writing files that the peer names
  Everything,
};

/// Returns the rights of `peer`: the owner and root have every right, members of the group may
/// steer.
[[nodiscard]] ControlRights rights_of(const ControlPeer& peer, const ControlPolicy& policy);

/// Returns the peer's credentials as reported by the kernel; none if the kernel does not report
/// them.
[[nodiscard]] std::optional<ControlPeer> peer_of(int socket);

/// Returns the group's id. Throws Error(Usage) if there is no group of that name.
[[nodiscard]] gid_t group_named(const std::string& name);

}  // namespace lenticule::player
