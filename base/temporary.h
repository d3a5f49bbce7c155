// SPDX-License-Identifier: Apache-2.0
// Temporary files and folders, each locked with flock() while its process uses it. The next process
// that makes one in the same folder removes the leftovers of killed processes: a lock that can be
// taken shows that the owner has exited. A name or a process number alone does not show this.
#pragma once

#include <cstddef>
#include <filesystem>

#include "base/unique_fd.h"

namespace lenticule {

/// TemporaryFile is a file beside its target that replaces the target when complete.
class TemporaryFile {
 public:
  TemporaryFile() = default;
  /// Calls create(). Throws Error(Failed) "target: cannot write: cause".
  explicit TemporaryFile(const std::filesystem::path& target);
  /// Removes the file unless keep() has succeeded.
  ~TemporaryFile();
  TemporaryFile(const TemporaryFile&) = delete;
  TemporaryFile& operator=(const TemporaryFile&) = delete;

  /// Creates the file with the mode that the process's umask gives, open for reading and writing.
  /// If the target is a symbolic link, the link stays and the file that the link names is replaced.
  /// Returns 0, an errno, or a negative number if the target is not a regular file.
  [[nodiscard]] int create(const std::filesystem::path& target);
  /// Returns true between create() and keep().
  [[nodiscard]] bool unfinished() const { return !name_.empty(); }
  [[nodiscard]] int fd() const { return file_.get(); }

  /// Syncs the file to the disk and renames it to the target. Returns 0 or the errno.
  [[nodiscard]] int keep();
  /// Calls keep(). Throws the same error as the constructor.
  void replace_target();

 private:
  [[nodiscard]] int resolve();
  [[nodiscard]] int create_once();
  [[noreturn]] void fail(int error) const;

  std::filesystem::path said_;    ///< the target as the caller named it, for messages
  std::filesystem::path target_;  ///< the target with symbolic links resolved
  std::filesystem::path name_;    ///< empty while no file is to be removed
  UniqueFd file_;
};

/// TemporaryFolder is a folder with mode 0700 that is removed with its content at destruction.
class TemporaryFolder {
 public:
  /// Creates the folder in `parent`, under a name that begins with a dot. Throws Error(Failed).
  explicit TemporaryFolder(const std::filesystem::path& parent);
  ~TemporaryFolder();
  TemporaryFolder(const TemporaryFolder&) = delete;
  TemporaryFolder& operator=(const TemporaryFolder&) = delete;

  [[nodiscard]] const std::filesystem::path& path() const { return path_; }

 private:
  std::filesystem::path path_;
  UniqueFd lock_;
};

/// Removes the files and folders that killed processes of this user left in `folder`, and returns
/// their number. The two classes above call this function themselves. Entries that cannot be
/// examined or removed stay.
size_t sweep_leftovers(const std::filesystem::path& folder) noexcept;

}  // namespace lenticule
