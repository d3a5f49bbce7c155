// SPDX-License-Identifier: Apache-2.0
// What a process gives up before it looks at a file that it did not write.
#pragma once

#include <sys/types.h>

#include <cstdint>

namespace lenticule::video {

/// Ends with `parent`: killed by the kernel when the thread that started us is gone. Returns false
/// if the parent is gone already.
[[nodiscard]] bool die_with(pid_t parent) noexcept;

/// The first to go when memory is short, whatever was inherited.
void volunteer_for_oom() noexcept;

/// From here on: no new descriptor (and none at all beyond the first `descriptors`, so that many
/// can be passed to it over a socket), no file grows (but one that standard output or error goes
/// to, by a MiB), no core dump, no new privilege, at most `extra_bytes` more address space, no
/// network (a namespace of its own where the kernel lets us), and no system call but those that
/// decoding on open descriptors takes. Threads can still be made; call it before the first one.
/// `parent` is that of die_with(), of which a change of namespaces makes the kernel forget; 0 =
/// none. Throws Error(Failed) when the filter cannot be installed, without which no foreign byte is
/// parsed, or when the parent is gone. Built with a sanitizer, which needs calls of its own, it
/// gives up nothing.
void confine(uint64_t extra_bytes, pid_t parent = 0, unsigned descriptors = 1);

}  // namespace lenticule::video
