// SPDX-License-Identifier: Apache-2.0
#include "base/file.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <sys/stat.h>
#include <unistd.h>

#include <atomic>
#include <cerrno>
#include <system_error>
#include <utility>

#include "base/error.h"

namespace lenticule {
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

/// "3 MiB, at most 1 MiB are read", in bytes where they are fewer.
std::string too_large(uint64_t size, uint64_t limit_bytes) {
  constexpr uint64_t kMebibyte = 1 << 20;
  if (limit_bytes < kMebibyte)
    return fmt::format("{} bytes, at most {} bytes are read", size, limit_bytes);
  return fmt::format("{} MiB, at most {} MiB are read", size / kMebibyte, limit_bytes / kMebibyte);
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

/// The rename reaches the disk with the folder. Where a folder cannot be synchronised, the file is
/// whole all the same.
void sync_folder_of(const std::filesystem::path& file) {
  const std::filesystem::path folder = file.has_parent_path() ? file.parent_path() : ".";
  const Descriptor directory(::open(folder.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC));
  if (directory.get() >= 0) (void)::fsync(directory.get());
}

/// Reads to the end of a regular file into `Bytes`, a container of bytes.
template <class Bytes>
Bytes read_file(const std::filesystem::path& file, uint64_t limit_bytes) {
  const OpenedFile in = open_regular_file(file, limit_bytes);
  Bytes bytes(in.bytes, {});
  size_t done = 0;
  while (done < bytes.size()) {
    const ssize_t n = ::read(in.descriptor.get(), bytes.data() + done, bytes.size() - done);
    if (n < 0 && errno == EINTR) continue;
    if (n < 0) fail_read(file, reason(errno));
    if (n == 0) break;  // the file shrank meanwhile; its parser finds it truncated
    done += static_cast<size_t>(n);
  }
  bytes.resize(done);
  return bytes;
}

}  // namespace

OpenedFile open_regular_file(const std::filesystem::path& file, uint64_t limit_bytes) {
  // O_NONBLOCK: opening a pipe must not wait for its other end.
  OpenedFile opened{UniqueFd(::open(file.c_str(), O_RDONLY | O_CLOEXEC | O_NONBLOCK)), 0};
  if (!opened.descriptor) fail_read(file, reason(errno));
  struct stat status {};
  if (::fstat(opened.descriptor.get(), &status) != 0) fail_read(file, reason(errno));
  if (S_ISDIR(status.st_mode)) fail_read(file, reason(EISDIR));
  if (!S_ISREG(status.st_mode)) fail_read(file, "not a regular file");
  opened.bytes = static_cast<uint64_t>(status.st_size);
  if (opened.bytes > limit_bytes) fail_read(file, too_large(opened.bytes, limit_bytes));
  return opened;
}

void write_file_atomically(const std::filesystem::path& file, std::span<const uint8_t> bytes) {
  const std::filesystem::path target = resolve_target(file);
  TemporaryName temporary(temporary_beside(target));
  Descriptor out(create_new(temporary));
  if (out.get() < 0) fail_write(file, errno);
  if (!write_all(out.get(), bytes) || ::fsync(out.get()) != 0) fail_write(file, errno);
  if (!out.close_reporting()) fail_write(file, errno);
  if (!temporary.rename_to(target)) fail_write(file, errno);
  sync_folder_of(target);
}

std::vector<uint8_t> read_whole_file(const std::filesystem::path& file, uint64_t limit_bytes) {
  return read_file<std::vector<uint8_t>>(file, limit_bytes);
}

std::string read_text_file(const std::filesystem::path& file, uint64_t limit_bytes) {
  return read_file<std::string>(file, limit_bytes);
}

void write_text_file(const std::filesystem::path& file, std::string_view text) {
  write_file_atomically(file, {reinterpret_cast<const uint8_t*>(text.data()), text.size()});
}

}  // namespace lenticule
