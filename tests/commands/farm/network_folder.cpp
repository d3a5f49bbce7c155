// SPDX-License-Identifier: Apache-2.0
// Loaded before the C library, this library makes a farm's work folder behave as on a network file
// system, for files that other processes have made:
//
// - FARM_LATE_MS=N: a file that was renamed to its name in the last N milliseconds is not there
// yet,
//   neither by name nor in a listing. The process's own files are there at once.
// - FARM_STALE=1: the first file that is opened under a name fails with ESTALE after a few reads,
// as
//   when another node renames a file to this name. It can be opened again.
#include <dirent.h>
#include <dlfcn.h>
#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cerrno>
#include <cstdarg>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <ctime>
#include <map>
#include <mutex>
#include <set>
#include <string>

namespace {

constexpr int kReadsBeforeStale = 6;
constexpr int64_t kMillisecond = 1'000'000;

std::mutex mutex;
/// Never destroyed: the program may read files while it exits.
auto& own_files = *new std::set<ino_t>;
auto& opened_names = *new std::set<std::string>;
auto& reads_left = *new std::map<int, int>;  ///< number of reads until a descriptor is stale

template <class Function>
Function next(const char* name) {
  return reinterpret_cast<Function>(dlsym(RTLD_NEXT, name));
}

bool is_shared(const char* path) {
  for (const char* part : {"/reports/", "/chunks/", "/predictors/", "/failures/"})
    if (path != nullptr && std::strstr(path, part) != nullptr) return true;
  return false;
}

int real_stat(const char* path, struct stat* to) {
  static const auto real = next<int (*)(const char*, struct stat*)>("stat");
  return real(path, to);
}

bool is_late(const char* path) {
  static const char* text = std::getenv("FARM_LATE_MS");
  struct stat status {};
  if (text == nullptr || !is_shared(path) || real_stat(path, &status) != 0) return false;
  timespec now{};
  clock_gettime(CLOCK_REALTIME, &now);
  const int64_t age = (now.tv_sec - status.st_ctim.tv_sec) * 1000 +
                      (now.tv_nsec - status.st_ctim.tv_nsec) / kMillisecond;
  const std::lock_guard lock(mutex);
  return age < std::atol(text) && own_files.count(status.st_ino) == 0;
}

int missing() {
  errno = ENOENT;
  return -1;
}

void note_opened(const char* path, int flags, int fd) {
  static const bool stale = std::getenv("FARM_STALE") != nullptr;
  if (!stale || fd < 0 || (flags & O_ACCMODE) != O_RDONLY || !is_shared(path)) return;
  const std::lock_guard lock(mutex);
  reads_left.erase(fd);
  if (opened_names.insert(path).second) reads_left[fd] = kReadsBeforeStale;
}

int open_file(const char* name, const char* path, int flags, mode_t mode) {
  if ((flags & O_CREAT) == 0 && is_late(path)) return missing();
  const int fd = next<int (*)(const char*, int, mode_t)>(name)(path, flags, mode);
  note_opened(path, flags, fd);
  return fd;
}

/// Returns the argument after the flags, which is there only if a file may be created.
mode_t mode_of(int flags, va_list arguments) {
  return (flags & (O_CREAT | O_TMPFILE)) != 0 ? va_arg(arguments, mode_t) : 0;
}

}  // namespace

extern "C" {

int open(const char* path, int flags, ...) {
  va_list arguments;
  va_start(arguments, flags);
  const mode_t mode = mode_of(flags, arguments);
  va_end(arguments);
  return open_file("open", path, flags, mode);
}

int open64(const char* path, int flags, ...) {
  va_list arguments;
  va_start(arguments, flags);
  const mode_t mode = mode_of(flags, arguments);
  va_end(arguments);
  return open_file("open64", path, flags, mode);
}

FILE* fopen(const char* path, const char* mode) {
  if (*mode == 'r' && is_late(path)) {
    errno = ENOENT;
    return nullptr;
  }
  return next<FILE* (*)(const char*, const char*)>("fopen")(path, mode);
}

int stat(const char* path, struct stat* to) noexcept {
  return is_late(path) ? missing() : real_stat(path, to);
}

int rename(const char* from, const char* to) noexcept {
  const int result = next<int (*)(const char*, const char*)>("rename")(from, to);
  struct stat status {};
  if (result == 0 && real_stat(to, &status) == 0) {
    const std::lock_guard lock(mutex);
    own_files.insert(status.st_ino);
  }
  return result;
}

ssize_t pread(int fd, void* to, size_t bytes, off_t offset) {
  {
    const std::lock_guard lock(mutex);
    const auto left = reads_left.find(fd);
    if (left != reads_left.end() && left->second-- <= 0) {
      errno = ESTALE;
      return -1;
    }
  }
  return next<ssize_t (*)(int, void*, size_t, off_t)>("pread")(fd, to, bytes, offset);
}

dirent* readdir(DIR* folder) {
  static const auto real = next<dirent* (*)(DIR*)>("readdir");
  while (dirent* entry = real(folder)) {
    const std::string link = "/proc/self/fd/" + std::to_string(dirfd(folder));
    char path[4096] = {};
    if (readlink(link.c_str(), path, sizeof(path) - 1) < 0) return entry;
    if (!is_late((std::string(path) + "/" + entry->d_name).c_str())) return entry;
  }
  return nullptr;
}
}
