// SPDX-License-Identifier: Apache-2.0
#include "base/file.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <sys/mman.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>

#include "base/error_kinds.h"
#include "base/temporary.h"
#include "base/text.h"

namespace lenticule {
namespace {

std::string reason(int error) { return std::generic_category().message(error); }

[[noreturn]] void fail_write(const std::filesystem::path& file, int error) {
  throw failed_error("{}: cannot write: {}", file.string(), reason(error))
      .remedy(error == ENOSPC || error == EDQUOT ? "free some space, or write somewhere else" : "");
}

[[noreturn]] void fail_read(const std::filesystem::path& file, const std::string& cause,
                            const std::string& remedy = {}) {
  throw input_error("{}: cannot read: {}", file.string(), cause).remedy(remedy);
}

[[noreturn]] void fail_read(const std::filesystem::path& file, int error) {
  fail_read(file, reason(error), read_remedy(file, error));
}

void require_regular(const std::filesystem::path& file, mode_t mode) {
  if (S_ISDIR(mode)) fail_read(file, EISDIR);
  if (!S_ISREG(mode))
    fail_read(file, fmt::format("it is {}, not a regular file", kind_of_file(mode)));
}

/// Returns for example "3 MiB, the limit is 1 MiB"; sizes below 1 MiB are given in bytes.
std::string too_large(uint64_t size, uint64_t limit_bytes) {
  constexpr uint64_t kMebibyte = 1 << 20;
  if (limit_bytes < kMebibyte)
    return fmt::format("{} bytes, the limit is {} bytes", size, limit_bytes);
  return fmt::format("{} MiB, the limit is {} MiB", size / kMebibyte, limit_bytes / kMebibyte);
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

/// Reads to the end of a regular file into `Bytes`, a container of bytes.
template <class Bytes>
Bytes read_file(const std::filesystem::path& file, uint64_t limit_bytes) {
  const OpenedFile in = open_regular_file(file, limit_bytes);
  Bytes bytes(in.bytes, {});
  const ssize_t n = read_from_start(in.descriptor.get(),
                                    {reinterpret_cast<uint8_t*>(bytes.data()), bytes.size()});
  if (n < 0) fail_read(file, errno);
  // If the file shrank while it was read, its parser reports the truncation.
  bytes.resize(static_cast<size_t>(n));
  return bytes;
}

}  // namespace

std::string read_remedy(const std::filesystem::path& file, int error) {
  if (error == EISDIR) return "name a file in it";
  if (error == EACCES || error == EPERM) return "give this user permission to read it";
  if (error != ENOENT && error != ENOTDIR) return {};
  if (file.string().find("://") != std::string::npos)
    return "download it first: only files of this machine are read";
  std::error_code ignored;
  const std::string here = std::filesystem::current_path(ignored).string();
  return file.is_relative() ? "correct the name; the current folder is " + here
                            : "correct the name";
}

OpenedFile open_regular_file(const std::filesystem::path& file, uint64_t limit_bytes) {
  struct stat status {};
  // stat() comes before open(), because open() alone has side effects on some devices.
  if (::stat(file.c_str(), &status) != 0) fail_read(file, errno);
  require_regular(file, status.st_mode);
  // O_NONBLOCK: if a pipe replaced the file after the stat(), open() must not wait for the pipe's
  // other end.
  constexpr int kFlags = O_RDONLY | O_CLOEXEC | O_NONBLOCK | O_NOCTTY;
  OpenedFile opened{UniqueFd(::open(file.c_str(), kFlags)), 0};
  if (!opened.descriptor || ::fstat(opened.descriptor.get(), &status) != 0) fail_read(file, errno);
  require_regular(file, status.st_mode);
  opened.bytes = static_cast<uint64_t>(status.st_size);
  if (opened.bytes > limit_bytes) fail_read(file, too_large(opened.bytes, limit_bytes));
  return opened;
}

ssize_t read_from_start(int descriptor, std::span<uint8_t> to) noexcept {
  size_t done = 0;
  while (done < to.size()) {
    const ssize_t n =
        ::pread(descriptor, to.data() + done, to.size() - done, static_cast<off_t>(done));
    if (n < 0 && errno == EINTR) continue;
    if (n < 0) return -1;
    if (n == 0) break;
    done += static_cast<size_t>(n);
  }
  return static_cast<ssize_t>(done);
}

UniqueFd file_in_memory(std::span<const uint8_t> bytes) {
  UniqueFd file(::memfd_create("lenticule-file", MFD_CLOEXEC));
  if (!file || !write_all(file.get(), bytes)) fail_write("a file in memory", errno);
  return file;
}

void write_file_atomically(const std::filesystem::path& file, std::span<const uint8_t> bytes) {
  TemporaryFile out(file);
  if (!write_all(out.fd(), bytes)) fail_write(file, errno);
  out.replace_target();
}

void sync_folder_of(const std::filesystem::path& file) noexcept {
  const UniqueFd folder(::open(file.has_parent_path() ? file.parent_path().c_str() : ".",
                               O_RDONLY | O_DIRECTORY | O_CLOEXEC));
  if (folder) (void)::fsync(folder.get());
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

std::vector<std::filesystem::path> entries_of(const std::filesystem::path& folder,
                                              std::error_code* error) {
  std::vector<std::filesystem::path> entries;
  std::error_code ignored;
  std::error_code& failure = error != nullptr ? *error : ignored;
  for (std::filesystem::directory_iterator at(folder, failure), end; !failure && at != end;
       at.increment(failure))
    entries.push_back(at->path());
  std::ranges::sort(
      entries, NaturalOrder(), [](const auto& entry) -> auto& { return entry.native(); });
  return entries;
}

}  // namespace lenticule
