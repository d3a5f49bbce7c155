// SPDX-License-Identifier: Apache-2.0
#include "frames/atomic_file.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <sys/stat.h>
#include <unistd.h>

#include <atomic>
#include <cerrno>
#include <system_error>
#include <utility>

#include "optics/error.h"

namespace lenticule::frames {
namespace {

std::string reason(int error) {
  return std::generic_category().message(error);
}

[[noreturn]] void fail_write(const std::filesystem::path& file, int error) {
  throw Error(ErrorKind::Failed, fmt::format("{}: cannot write: {}", file.string(), reason(error)),
              error == ENOSPC || error == EDQUOT ? "free some space, or write somewhere else" : "");
}

[[noreturn]] void fail_read(const std::filesystem::path& file, const std::string& cause) {
  throw Error(ErrorKind::Input, fmt::format("{}: cannot read: {}", file.string(), cause));
}

class Descriptor {
 public:
  explicit Descriptor(int fd) : fd_(fd) {}
  ~Descriptor() {
    if (fd_ >= 0) ::close(fd_);
  }
  Descriptor(const Descriptor&) = delete;
  Descriptor& operator=(const Descriptor&) = delete;
  [[nodiscard]] int get() const { return fd_; }
  /// Network file systems report a full disk no sooner than here.
  [[nodiscard]] bool close_reporting() { return ::close(std::exchange(fd_, -1)) == 0; }

 private:
  int fd_;
};

/// A name that is gone at the end of the scope unless it was renamed away.
class TemporaryName {
 public:
  explicit TemporaryName(std::filesystem::path name) : name_(std::move(name)) {}
  ~TemporaryName() {
    if (!name_.empty()) ::unlink(name_.c_str());
  }
  TemporaryName(const TemporaryName&) = delete;
  TemporaryName& operator=(const TemporaryName&) = delete;
  [[nodiscard]] const char* c_str() const { return name_.c_str(); }
  [[nodiscard]] bool rename_to(const std::filesystem::path& target) {
    if (::rename(name_.c_str(), target.c_str()) != 0) return false;
    name_.clear();
    return true;
  }

 private:
  std::filesystem::path name_;
};

/// Short whatever the target's name, so that it exists wherever the target can.
std::filesystem::path temporary_beside(const std::filesystem::path& target) {
  static std::atomic<uint64_t> counter{0};
  return target.parent_path() / fmt::format(".lenticule-{}-{}.tmp", ::getpid(), counter++);
}

/// Where a chain of symbolic links ends; the link itself must survive the rename.
std::filesystem::path resolve_target(const std::filesystem::path& file) {
  std::error_code absent;  // a file that is not there yet is no error
  std::filesystem::path target = file;
  if (std::filesystem::is_symlink(file, absent)) {
    std::error_code error;
    target = std::filesystem::weakly_canonical(file, error);
    if (error) fail_write(file, error.value());
  }

  const auto status = std::filesystem::status(target, absent);
  if (std::filesystem::is_directory(status)) fail_write(file, EISDIR);
  if (std::filesystem::exists(status) && !std::filesystem::is_regular_file(status))
    throw Error(ErrorKind::Failed,
                fmt::format("{}: cannot write: not a regular file", file.string()));
  return target;
}

bool write_all(int fd, std::span<const uint8_t> bytes) {
  while (!bytes.empty()) {
    const ssize_t n = ::write(fd, bytes.data(), bytes.size());
    if (n < 0 && errno == EINTR) continue;
    if (n < 0) return false;
    bytes = bytes.subspan(static_cast<size_t>(n));
  }
  return true;
}

/// A name left by a process that was killed and had our number must not stop us.
int create_new(TemporaryName& name) {
  constexpr int kFlags = O_WRONLY | O_CREAT | O_EXCL | O_CLOEXEC;
  const int fd = ::open(name.c_str(), kFlags, 0666);
  if (fd >= 0 || errno != EEXIST) return fd;
  ::unlink(name.c_str());
  return ::open(name.c_str(), kFlags, 0666);
}

}  // namespace

void write_file_atomically(const std::filesystem::path& file, std::span<const uint8_t> bytes) {
  const std::filesystem::path target = resolve_target(file);
  TemporaryName temporary(temporary_beside(target));
  Descriptor out(create_new(temporary));
  if (out.get() < 0) fail_write(file, errno);
  if (!write_all(out.get(), bytes) || ::fsync(out.get()) != 0) fail_write(file, errno);
  if (!out.close_reporting()) fail_write(file, errno);
  if (!temporary.rename_to(target)) fail_write(file, errno);
}

std::vector<uint8_t> read_whole_file(const std::filesystem::path& file, uint64_t limit_bytes) {
  // O_NONBLOCK: opening a pipe must not wait for its other end.
  Descriptor in(::open(file.c_str(), O_RDONLY | O_CLOEXEC | O_NONBLOCK));
  if (in.get() < 0) fail_read(file, reason(errno));
  struct stat status {};
  if (::fstat(in.get(), &status) != 0) fail_read(file, reason(errno));
  if (S_ISDIR(status.st_mode)) fail_read(file, reason(EISDIR));
  if (!S_ISREG(status.st_mode)) fail_read(file, "not a regular file");
  const auto size = static_cast<uint64_t>(status.st_size);
  if (size > limit_bytes)
    fail_read(file, fmt::format("{} MiB, at most {} MiB are read", size >> 20, limit_bytes >> 20));

  std::vector<uint8_t> bytes(size);
  size_t done = 0;
  while (done < bytes.size()) {
    const ssize_t n = ::read(in.get(), bytes.data() + done, bytes.size() - done);
    if (n < 0 && errno == EINTR) continue;
    if (n < 0) fail_read(file, reason(errno));
    if (n == 0) break;  // it shrank meanwhile; whoever decodes it finds it truncated
    done += static_cast<size_t>(n);
  }
  bytes.resize(done);
  return bytes;
}

}  // namespace lenticule::frames
