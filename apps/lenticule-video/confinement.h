// SPDX-License-Identifier: Apache-2.0
// Confines a process before it reads an untrusted file.
#pragma once

#include <linux/filter.h>
#include <sys/types.h>

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "base/unique_fd.h"

namespace lenticule::video {

/// LandlockRules restricts which files a process may open, by the kernel's Landlock.
///
/// LandlockRules is a set of files that stay accessible. After enforce() every other access to
/// files by name that the kernel's Landlock knows is refused; open descriptors keep their rights.
class LandlockRules {
 public:
  /// Returns an empty set; none if the kernel has no Landlock, or a service manager forbids it
  /// (errno states which).
  [[nodiscard]] static std::optional<LandlockRules> create();

  /// Allows to open this device for reading and writing, and to control it. Returns false if the
  /// device is gone.
  [[nodiscard]] bool allow_device(const std::string& node);
  /// Allows to list this folder and those below it.
  [[nodiscard]] bool allow_listing(const std::string& folder);

  /// Restricts the process permanently, which must have no_new_privs and a single thread. Returns
  /// false, and restricts nothing, if the kernel refuses.
  [[nodiscard]] bool enforce() const;

 private:
  LandlockRules(UniqueFd rules, uint64_t handled);
  [[nodiscard]] bool allow(const std::string& path, uint64_t rights);

  UniqueFd rules_;
  uint64_t handled_;  ///< rights that this kernel knows
};

// decoder_filter lists the system calls that a decoder may make, as a classic BPF program.

/// Devices that a decoder may open beside the descriptors that it has.
enum class Devices {
  None,
  /// Opening files and listing folders, which Landlock must restrict, and controlling video devices
  /// (VIDIOC_...).
  Video,
};

/// Returns a filter in which calls that are not listed fail with EPERM, and calls of a foreign
/// architecture kill the process. Signals to other processes, connecting, executing, changing
/// identity or scheduling, and executable memory are not allowed; neither is opening without
/// devices. Uses one descriptor while it runs. Throws Error(Failed).
///
/// With `makes_files`, files in memory and pairs of sockets can be made, to pass them on.
[[nodiscard]] std::vector<sock_filter> decoder_filter(Devices devices = Devices::None,
                                                      bool makes_files = false);

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
/// Where the kernel has Landlock, it refuses all files, too. With `made_file_bytes` the process may
/// make files in memory of this size.
void confine(uint64_t extra_bytes, pid_t parent = 0, unsigned descriptors = 1,
             uint64_t made_file_bytes = 0);

/// Confines the process, but lets it open these video devices and list /dev, and nothing else, as
/// the kernel's Landlock ensures. Returns an empty text. Without Landlock the process is confined
/// as by confine(), and the reason is returned.
[[nodiscard]] std::string confine_with_devices(uint64_t extra_bytes, pid_t parent,
                                               const std::vector<std::string>& nodes);

}  // namespace lenticule::video
