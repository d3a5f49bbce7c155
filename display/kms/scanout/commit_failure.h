// SPDX-License-Identifier: Apache-2.0
// CommitFailure classifies the kernel's reasons to refuse a commit by the reaction that each needs.
#pragma once

#include <cerrno>

namespace lenticule::display {

enum class CommitFailure {
  Busy,    ///< a commit is pending: try again later
  Denied,  ///< another process is DRM master at the moment: wait
  Gone,    ///< the card is gone
  Wrong,   ///< the output's state is not the expected one
};

/// Returns the class of `error`, a negative errno.
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
