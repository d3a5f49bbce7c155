// SPDX-License-Identifier: Apache-2.0
// Who is at the other end of a Unix socket, and whether that may steer a player.
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
  Steer,  ///< everything that writes no file that the peer names
  Everything,
};

/// The owner and root have every right, members of the group may steer.
[[nodiscard]] ControlRights rights_of(const ControlPeer& peer, const ControlPolicy& policy);

/// As the kernel says; none if it does not.
[[nodiscard]] std::optional<ControlPeer> peer_of(int socket);

/// Throws Error(Usage) if there is none of that name.
[[nodiscard]] gid_t group_named(const std::string& name);

}  // namespace lenticule::player
