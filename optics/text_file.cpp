// SPDX-License-Identifier: Apache-2.0
#include "optics/text_file.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cerrno>
#include <cstdlib>
#include <cstring>
#include <utility>

#include "optics/error.h"

namespace lenticule::optics {
namespace {

class File {
 public:
  explicit File(int fd) : fd_(fd) {}
  File(const File&) = delete;
  File& operator=(const File&) = delete;
  ~File() { close(); }

  [[nodiscard]] int fd() const { return fd_; }
  /// False if what was written did not arrive.
  bool close() { return fd_ < 0 || ::close(std::exchange(fd_, -1)) == 0; }

 private:
  int fd_;
};

/// Removes the temporary file unless it was renamed.
class Temporary {
 public:
  explicit Temporary(std::string path) : path_(std::move(path)) {}
  Temporary(const Temporary&) = delete;
  Temporary& operator=(const Temporary&) = delete;
  ~Temporary() {
    if (!path_.empty()) ::unlink(path_.c_str());
  }
  void keep() { path_.clear(); }

 private:
  std::string path_;
};

[[noreturn]] void fail(ErrorKind kind, const std::filesystem::path& file, const char* what,
                       int error) {
  throw Error(kind, fmt::format("{}: {}: {}", file.string(), what, std::strerror(error)));
}

bool write_all(int fd, std::string_view text) {
  while (!text.empty()) {
    const ssize_t written = ::write(fd, text.data(), text.size());
    if (written < 0 && errno == EINTR) continue;
    if (written < 0) return false;
    text.remove_prefix(static_cast<size_t>(written));
  }
  return true;
}

/// mkstemp makes private files; a rig is as readable as any new file of this user.
mode_t mode_of_new_files() {
  const mode_t mask = ::umask(0);
  ::umask(mask);
  return 0666 & ~mask;
}

}  // namespace

std::string read_text_file(const std::filesystem::path& file, size_t max_bytes) {
  // Non-blocking, so that opening a pipe without a writer does not wait.
  const File in(::open(file.c_str(), O_RDONLY | O_CLOEXEC | O_NONBLOCK));
  if (in.fd() < 0) fail(ErrorKind::Input, file, "cannot open", errno);
  struct stat info {};
  if (::fstat(in.fd(), &info) != 0) fail(ErrorKind::Input, file, "cannot read", errno);
  if (!S_ISREG(info.st_mode)) {
    throw Error(ErrorKind::Input, fmt::format("{}: not a regular file", file.string()));
  }
  std::string text;
  char buffer[1 << 14];
  for (;;) {
    const ssize_t got = ::read(in.fd(), buffer, sizeof buffer);
    if (got < 0 && errno == EINTR) continue;
    if (got < 0) fail(ErrorKind::Input, file, "cannot read", errno);
    if (got == 0) return text;
    text.append(buffer, static_cast<size_t>(got));
    if (text.size() > max_bytes) {
      throw Error(ErrorKind::Input, fmt::format("{}: larger than {} bytes, so not such a file",
                                                file.string(), max_bytes));
    }
  }
}

void write_text_file(const std::filesystem::path& file, std::string_view text) {
  const std::filesystem::path folder =
      file.has_parent_path() ? file.parent_path() : std::filesystem::path(".");
  std::string name = fmt::format("{}/.{}.XXXXXX", folder.string(), file.filename().string());
  File out(::mkostemp(name.data(), O_CLOEXEC));
  if (out.fd() < 0) fail(ErrorKind::Failed, file, "cannot create", errno);
  Temporary temporary(name);
  if (!write_all(out.fd(), text) || ::fchmod(out.fd(), mode_of_new_files()) != 0 ||
      ::fsync(out.fd()) != 0 || !out.close()) {
    fail(ErrorKind::Failed, file, "cannot write", errno);
  }
  if (::rename(name.c_str(), file.c_str()) != 0) {
    fail(ErrorKind::Failed, file, "cannot replace", errno);
  }
  temporary.keep();
  // The rename itself reaches the disk with the folder; where a folder cannot be synchronised the
  // file is whole all the same.
  const File directory(::open(folder.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC));
  if (directory.fd() >= 0) (void)::fsync(directory.fd());
}

}  // namespace lenticule::optics
