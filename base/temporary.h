// SPDX-License-Identifier: Apache-2.0
// Files and folders that are there only as long as their process works on them. Each carries a lock
// (flock) until then. What a killed process left is removed by the next process that makes one in
// the same folder: a lock that can be taken says that the owner is gone, a name or a process number
// alone does not.
#pragma once

#include <cstddef>
#include <filesystem>

#include "base/unique_fd.h"

namespace lenticule {

/// TemporaryFile is a file beside its target that takes the target's place when it is whole.
class TemporaryFile {
 public:
  TemporaryFile() = default;
  /// As create(). Throws Error(Failed) "target: cannot write: cause".
  explicit TemporaryFile(const std::filesystem::path& target);
  /// Removes it unless it was kept.
  ~TemporaryFile();
  TemporaryFile(const TemporaryFile&) = delete;
  TemporaryFile& operator=(const TemporaryFile&) = delete;

  /// Creates it with the mode that the process's umask gives, open for reading and writing. A
  /// target that is a symbolic link stays one: the file that it names is replaced. Returns 0 or the
  /// errno, a negative number for a target that is not a regular file.
  [[nodiscard]] int create(const std::filesystem::path& target);
  /// True between create() and keep().
  [[nodiscard]] bool unfinished() const { return !name_.empty(); }
  [[nodiscard]] int fd() const { return file_.get(); }

  /// Brings its bytes to the disk and gives it the target's name. Returns 0 or the errno.
  [[nodiscard]] int keep();
  /// As keep(). Throws as the constructor.
  void replace_target();

 private:
  [[nodiscard]] int resolve();
  [[nodiscard]] int create_once();
  [[noreturn]] void fail(int error) const;

  std::filesystem::path said_;    ///< the target as the caller named it, for messages
  std::filesystem::path target_;  ///< the same with links followed
  std::filesystem::path name_;    ///< empty while there is nothing to remove
  UniqueFd file_;
};

/// TemporaryFolder is a folder with mode 0700 that goes away with all that is in it.
class TemporaryFolder {
 public:
  /// Creates it in `parent`, under a name that begins with a dot. Throws Error(Failed).
  explicit TemporaryFolder(const std::filesystem::path& parent);
  ~TemporaryFolder();
  TemporaryFolder(const TemporaryFolder&) = delete;
  TemporaryFolder& operator=(const TemporaryFolder&) = delete;

  [[nodiscard]] const std::filesystem::path& path() const { return path_; }

 private:
  std::filesystem::path path_;
  UniqueFd lock_;
};

/// Removes what killed processes of this user left in `folder`; the two classes above do that
/// themselves. Returns how many files and folders. What cannot be looked at or removed stays.
size_t sweep_leftovers(const std::filesystem::path& folder) noexcept;

}  // namespace lenticule
