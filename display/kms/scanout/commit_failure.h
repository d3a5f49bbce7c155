// SPDX-License-Identifier: Apache-2.0
// What the kernel's refusal of a commit asks for.
#pragma once

#include <cerrno>

namespace lenticule::display {

enum class CommitFailure {
  Busy,    ///< a commit is under way: again later
  Denied,  ///< the card is not ours at the moment: wait for it
  Gone,    ///< the card went away
  Wrong,   ///< the state is not what we think
};

/// `error` is a negative errno.
[[nodiscard]] constexpr CommitFailure classify(int error) noexcept {
  switch (-error) {
    case EBUSY:
      return CommitFailure::Busy;
    case EACCES:
    case EPERM:
      return CommitFailure::Denied;
    case ENODEV:
    case EIO:
    case ENXIO:
    case EBADF:
      return CommitFailure::Gone;
    default:
      return CommitFailure::Wrong;
  }
}

}  // namespace lenticule::display
