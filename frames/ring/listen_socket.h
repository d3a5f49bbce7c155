// SPDX-License-Identifier: Apache-2.0
// ListenSocket is the Unix socket on which a player listens: a file with mode 0600, or 0660 for a
// group, that is removed when the player exits.
#pragma once

#include <fcntl.h>
#include <sys/file.h>
#include <sys/socket.h>
#include <sys/stat.h>

#include <cerrno>
#include <chrono>
#include <cstring>
#include <filesystem>
#include <optional>
#include <thread>

#include "base/error.h"
#include "base/unique_fd.h"
#include "base/unix_address.h"

namespace lenticule::frames {

struct ListenOptions {
  int type = SOCK_SEQPACKET;
  /// Group whose members may connect in addition to the owner.
  std::optional<gid_t> group = std::nullopt;
};

inline constexpr int kBacklog = 8;
inline constexpr int kLockTries = 200;
inline constexpr auto kLockPause = std::chrono::milliseconds(10);

[[noreturn]] inline void fail(const std::filesystem::path& path, const char* what) {
  const int error = errno;
  const char* hint = error == ENOENT ? "create the folder first" : "";
  throw Error(ErrorKind::Failed, path.string() + ": " + what + ": " + std::strerror(error), hint);
}

/// Locks the socket's folder while a player examines the socket file: two players that start at
/// once must not both find a stale socket and replace each other's.
inline UniqueFd lock_folder(const std::filesystem::path& path) {
  const auto folder = path.has_parent_path() ? path.parent_path() : std::filesystem::path(".");
  UniqueFd fd(::open(folder.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC));
  if (!fd) fail(path, "cannot open its folder");
  for (int i = 0; i < kLockTries; ++i) {
    if (::flock(fd.get(), LOCK_EX | LOCK_NB) == 0) return fd;
    std::this_thread::sleep_for(kLockPause);
  }
  throw Error(ErrorKind::Device, path.string() + ": another program holds the lock of its folder");
}

/// Removes the socket file of a program that has exited. Throws if anything else has that name.
inline void clear_the_way(const std::filesystem::path& path, const UnixAddress& address) {
  struct stat status;
  if (::lstat(path.c_str(), &status) != 0) {
    if (errno == ENOENT) return;
    fail(path, "cannot get the status of the file");
  }
  if (!S_ISSOCK(status.st_mode))
    throw Error(ErrorKind::Usage, path.string() + ": exists and is not a socket",
                "use another name");
  const UniqueFd probe(::socket(AF_UNIX, SOCK_SEQPACKET | SOCK_CLOEXEC | SOCK_NONBLOCK, 0));
  if (!probe) fail(path, "cannot create a socket");
  if (::connect(probe.get(), address.get(), address.bytes) == 0 || errno != ECONNREFUSED)
    throw Error(ErrorKind::Device, path.string() + ": already in use by another program",
                "stop that program, or use another socket");
  if (::unlink(path.c_str()) != 0) fail(path, "cannot replace the socket of a dead program");
}

/// Returns another name in the same folder, of the same length, so that it is a valid address, too.
inline std::filesystem::path preliminary_name(const std::filesystem::path& path) {
  std::string name = path.string();
  name.back() = name.back() == '~' ? '-' : '~';
  return name;
}

/// Removes the preliminary name of the socket's file.
class PreliminaryName {
 public:
  explicit PreliminaryName(const std::filesystem::path& path) : path_(path) {}
  ~PreliminaryName() { ::unlink(path_.c_str()); }
  PreliminaryName(const PreliminaryName&) = delete;
  PreliminaryName& operator=(const PreliminaryName&) = delete;

 private:
  const std::filesystem::path& path_;
};

/// Sets the group before the mode, so that no other group can connect at any moment.
inline bool open_to_group(const std::filesystem::path& path, gid_t group) {
  return ::chown(path.c_str(), static_cast<uid_t>(-1), group) == 0 &&
         ::chmod(path.c_str(), S_IRUSR | S_IWUSR | S_IRGRP | S_IWGRP) == 0;
}

class ListenSocket {
 public:
  /// Replaces the socket file of a player that has exited; the new one appears when clients can
  /// connect. Throws Error(Device) when a live player listens there, Error(Usage) when the path is
  /// too long or names something other than a socket, Error(Failed) otherwise.
  // The file gets its name last: a program that waits for it can connect at once.
  explicit ListenSocket(std::filesystem::path path, const ListenOptions& options = {})
      : path_(std::move(path)) {
    const UnixAddress address = unix_address(path_);
    const std::filesystem::path preliminary = preliminary_name(path_);
    const UnixAddress preliminary_address = unix_address(preliminary);
    const UniqueFd lock = lock_folder(path_);
    clear_the_way(path_, address);
    clear_the_way(preliminary, preliminary_address);
    fd_ = UniqueFd(::socket(AF_UNIX, options.type | SOCK_CLOEXEC | SOCK_NONBLOCK, 0));
    if (!fd_) fail(path_, "cannot create a socket");
    // The file gets the mode that the socket has before bind(), minus the umask: never wider.
    if (::fchmod(fd_.get(), S_IRUSR | S_IWUSR) != 0) fail(path_, "cannot restrict the socket");
    if (::bind(fd_.get(), preliminary_address.get(), preliminary_address.bytes) != 0)
      fail(path_, "cannot create the socket");
    const PreliminaryName removed_at_the_end(preliminary);
    struct stat status;
    if (::stat(preliminary.c_str(), &status) == 0) {
      device_ = status.st_dev;
      inode_ = status.st_ino;
    }
    if (options.group && !open_to_group(preliminary, *options.group))
      fail(path_, "cannot change the group of the socket");
    const bool has_connections = options.type != SOCK_DGRAM;
    if (has_connections && ::listen(fd_.get(), kBacklog) != 0) fail(path_, "cannot listen");
    // Unlike rename(), link() does not replace a file that appeared meanwhile.
    if (::link(preliminary.c_str(), path_.c_str()) != 0) fail(path_, "cannot create the socket");
  }
  ~ListenSocket() {
    struct stat status;
    const bool ours =
        ::lstat(path_.c_str(), &status) == 0 && status.st_dev == device_ && status.st_ino == inode_;
    if (ours) ::unlink(path_.c_str());
  }
  ListenSocket(const ListenSocket&) = delete;
  ListenSocket& operator=(const ListenSocket&) = delete;

  [[nodiscard]] int fd() const { return fd_.get(); }
  /// Returns the next waiting connection; empty if there is none. Never blocks.
  [[nodiscard]] UniqueFd accept() const noexcept {
    for (;;) {
      UniqueFd peer(::accept4(fd_.get(), nullptr, nullptr, SOCK_CLOEXEC | SOCK_NONBLOCK));
      if (peer || (errno != EINTR && errno != ECONNABORTED)) return peer;
    }
  }

 private:
  std::filesystem::path path_;
  UniqueFd fd_;
  dev_t device_ = 0;
  ino_t inode_ = 0;
};

}  // namespace lenticule::frames
