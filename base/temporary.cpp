// SPDX-License-Identifier: Apache-2.0
#include "base/temporary.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <unistd.h>

#include <atomic>
#include <cerrno>
#include <cstdlib>
#include <mutex>
#include <set>
#include <string>
#include <system_error>

#include "base/error_kinds.h"
#include "base/file.h"

namespace lenticule {
namespace {

namespace fs = std::filesystem;

constexpr std::string_view kFilePrefix = ".lenticule-";
constexpr std::string_view kFileSuffix = ".unfinished";
constexpr std::string_view kFolderPrefix = ".lenticule-unfinished-";
constexpr std::string_view kFolderEnd = "XXXXXX";
/// Limits the number of names tried in a row. Another process's sweep holds a lock only for a
/// moment, so it cannot take this many names.
constexpr int kAttempts = 100;
/// Limits how many swept folders are remembered; a process that writes into more of them sweeps
/// some folders again.
constexpr size_t kMostFolders = 256;
/// Returned for targets such as pipes.
constexpr int kNotRegular = EINVAL;

std::string reason(int error) { return std::generic_category().message(error); }

/// Returns true if `path` still names the open file.
bool names(const fs::path& path, int fd) noexcept {
  struct stat open_file {};
  struct stat named {};
  return ::fstat(fd, &open_file) == 0 && ::lstat(path.c_str(), &named) == 0 &&
         open_file.st_dev == named.st_dev && open_file.st_ino == named.st_ino;
}

/// Takes the owner's lock on a new file or folder. Returns false if a sweep of another process came
/// first. Returns true on file systems without locks, where no sweep removes anything either.
bool hold(const fs::path& path, int fd) noexcept {
  if (::flock(fd, LOCK_EX | LOCK_NB) != 0) return errno != EWOULDBLOCK;
  return names(path, fd);
}

/// Removes a file or folder of this user if the owner's lock can be taken.
bool remove_leftover(const fs::path& path) {
  struct stat status {};
  if (::lstat(path.c_str(), &status) != 0 || status.st_uid != ::geteuid()) return false;
  const bool folder = S_ISDIR(status.st_mode);
  if (!folder && !S_ISREG(status.st_mode)) return false;
  const int access = folder ? O_RDONLY | O_DIRECTORY : O_RDWR;
  const UniqueFd fd(::open(path.c_str(), access | O_NOFOLLOW | O_NONBLOCK | O_CLOEXEC));
  if (!fd || ::flock(fd.get(), LOCK_EX | LOCK_NB) != 0 || !names(path, fd.get())) return false;
  if (!folder) return ::unlink(path.c_str()) == 0;
  std::error_code error;
  fs::remove_all(path, error);
  return !error;
}

bool is_our_name(std::string_view name) {
  const bool file = name.starts_with(kFilePrefix) && name.ends_with(kFileSuffix);
  const bool folder =
      name.starts_with(kFolderPrefix) && name.size() == kFolderPrefix.size() + kFolderEnd.size();
  return file || folder;
}

size_t sweep(const fs::path& folder) noexcept {
  size_t removed = 0;
  try {
    std::error_code error;
    for (fs::directory_iterator entry(folder, error), end; !error && entry != end;
         entry.increment(error)) {
      const bool ours = is_our_name(entry->path().filename().string());
      if (ours && remove_leftover(entry->path())) ++removed;
    }
  } catch (const std::exception&) {  // out of memory: the next start tries again
  }
  return removed;
}

/// Sweeps a folder only when this process first writes there, because thousands of frames may
/// follow.
void sweep_once(const fs::path& folder) {
  static std::mutex mutex;
  static std::set<std::string> swept;
  {
    const std::lock_guard lock(mutex);
    if (swept.size() >= kMostFolders) swept.clear();
    if (!swept.insert(folder.string()).second) return;
  }
  (void)sweep(folder);
}

fs::path folder_of(const fs::path& file) {
  return file.has_parent_path() ? file.parent_path() : fs::path(".");
}

/// Returns a temporary name beside `target`. The name is short, so that every file system that can
/// hold the target can hold it, too.
fs::path temporary_beside(const fs::path& target) {
  static std::atomic<uint64_t> counter{0};
  return target.parent_path() /
         fmt::format("{}{}-{}{}", kFilePrefix, ::getpid(), counter++, kFileSuffix);
}

}  // namespace

size_t sweep_leftovers(const fs::path& folder) noexcept { return sweep(folder); }

// --- files -------------------------------------------------------------------------------------

TemporaryFile::TemporaryFile(const fs::path& target) {
  if (const int error = create(target)) fail(error);
}

TemporaryFile::~TemporaryFile() {
  if (!name_.empty()) ::unlink(name_.c_str());
}

int TemporaryFile::create(const fs::path& target) {
  LENTICULE_CHECK(name_.empty());
  said_ = target;
  if (const int error = resolve()) return error;
  sweep_once(folder_of(target_));
  for (int attempt = 0; attempt < kAttempts; ++attempt) {
    const int error = create_once();
    if (error != EEXIST) return error;
  }
  return EBUSY;
}

/// Resolves symbolic links: the link itself must survive the rename.
int TemporaryFile::resolve() {
  std::error_code absent;  // set when the target does not exist yet, which is not an error
  target_ = said_;
  if (fs::is_symlink(said_, absent)) {
    std::error_code error;
    target_ = fs::weakly_canonical(said_, error);
    if (error) return error.value();
  }
  const auto status = fs::status(target_, absent);
  if (fs::is_directory(status)) return EISDIR;
  return fs::exists(status) && !fs::is_regular_file(status) ? kNotRegular : 0;
}

/// Creates the file under a new name. Returns EEXIST if the name is taken: a killed process may
/// have had our process number, and we may not be allowed to remove its file.
int TemporaryFile::create_once() {
  const fs::path name = temporary_beside(target_);
  const int fd = ::open(name.c_str(), O_RDWR | O_CREAT | O_EXCL | O_CLOEXEC, 0666);
  if (fd < 0) return errno;
  file_ = UniqueFd(fd);
  if (!hold(name, fd)) return EEXIST;  // another process's sweep removed the file
  name_ = name;
  return 0;
}

void TemporaryFile::fail(int error) const {
  const std::string cause = error == kNotRegular ? "it is not a regular file" : reason(error);
  throw failed_error("{}: cannot write: {}", said_.string(), cause)
      .remedy(error == ENOSPC || error == EDQUOT ? "free some space, or write somewhere else" : "");
}

int TemporaryFile::keep() {
  LENTICULE_CHECK(!name_.empty());
  if (::fsync(file_.get()) != 0) return errno;
  // Some network file systems report a full disk only at close(). Closing a copy keeps the lock.
  const int copy = ::fcntl(file_.get(), F_DUPFD_CLOEXEC, 0);
  if (copy < 0 || ::close(copy) != 0) return errno;
  if (::rename(name_.c_str(), target_.c_str()) != 0) return errno;
  name_.clear();
  sync_folder_of(target_);
  return 0;
}

void TemporaryFile::replace_target() {
  if (const int error = keep()) fail(error);
}

// --- folders -----------------------------------------------------------------------------------

TemporaryFolder::TemporaryFolder(const fs::path& parent) {
  (void)sweep_leftovers(parent);
  for (int attempt = 0; attempt < kAttempts; ++attempt) {
    std::string name = (parent / fmt::format("{}{}", kFolderPrefix, kFolderEnd)).string();
    if (::mkdtemp(name.data()) == nullptr)
      throw failed_error("{}: cannot create: {}", name, reason(errno));
    path_ = name;
    lock_ = UniqueFd(::open(name.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC));
    if (lock_ && hold(path_, lock_.get())) return;
  }
  throw failed_error("{}: cannot create a folder there", parent.string());
}

TemporaryFolder::~TemporaryFolder() {
  std::error_code ignored;
  fs::remove_all(path_, ignored);
}

}  // namespace lenticule
