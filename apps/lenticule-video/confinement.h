// SPDX-License-Identifier: Apache-2.0
// Confines a process before it reads an untrusted file.
#pragma once

#include <sys/types.h>

#include <cstdint>
#include <string>
#include <vector>

namespace lenticule::video {

/// Makes the kernel kill this process when the parent's thread that started it ends. Returns false
/// if the parent is gone already.
[[nodiscard]] bool die_with(pid_t parent) noexcept;

/// Makes this process the first that the kernel kills when memory is short, independent of
/// inherited settings.
void volunteer_for_oom() noexcept;

/// Restricts the process permanently: no new descriptors (at most `descriptors` in total, so that
/// some can be passed over a socket), no growing files (except a MiB for one that standard output
/// or error is redirected to), no core dumps, no new privileges, at most `extra_bytes` more address
/// space, no network (its own namespace if the kernel permits it), and no system calls except those
/// needed to decode from open descriptors. Threads can still be created; call it before the first
/// one. `parent` is that of die_with(), which a change of namespaces resets; 0 = none. Throws
/// Error(Failed) if the parent is gone or the filter cannot be installed, because untrusted data
/// must not be parsed without it. Builds with a sanitizer, which needs further system calls, are
/// not restricted.
void confine(uint64_t extra_bytes, pid_t parent = 0, unsigned descriptors = 1);

/// Confines the process, but lets it open these video devices and list /dev, and nothing else, as
/// the kernel's Landlock ensures. Returns an empty text. Without Landlock the process is confined
/// as by confine(), and the reason is returned.
[[nodiscard]] std::string confine_with_devices(uint64_t extra_bytes, pid_t parent,
                                               const std::vector<std::string>& nodes);

}  // namespace lenticule::video
