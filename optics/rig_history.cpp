// SPDX-License-Identifier: Apache-2.0
#include "optics/rig_history.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <unistd.h>

#include <algorithm>
#include <atomic>
#include <cerrno>
#include <cstdint>
#include <cstdio>
#include <string>
#include <string_view>
#include <system_error>
#include <utility>

#include "base/error.h"
#include "base/file.h"
#include "base/numbers.h"
#include "optics/rig_file.h"

namespace lenticule::optics {
namespace {

constexpr size_t kMaxFileBytes = 16U << 20;

/// CopyName holds "rig" and ".toml" of "rig.toml".
struct CopyName {
  std::filesystem::path folder;
  std::string stem;
  std::string extension;

  explicit CopyName(const std::filesystem::path& file)
      : folder(file.has_parent_path() ? file.parent_path() : std::filesystem::path(".")),
        stem(file.stem().string()),
        extension(file.extension().string()) {}

  [[nodiscard]] std::filesystem::path numbered(uint64_t number) const {
    return folder / fmt::format("{}.{}{}", stem, number, extension);
  }
  /// Returns the number in `name`, 0 if it is not a numbered copy.
  [[nodiscard]] uint64_t number_of(const std::string& name) const {
    const size_t around = stem.size() + 1 + extension.size();
    if (name.size() <= around || name.size() > around + 9) return 0;
    if (!name.starts_with(stem + ".") || !name.ends_with(extension)) return 0;
    return number_from<uint64_t>(
               std::string_view(name).substr(stem.size() + 1, name.size() - around))
        .value_or(0);
  }
};

uint64_t highest_number(const CopyName& name) {
  uint64_t highest = 0;
  std::error_code error;  // if the folder cannot be listed, the next step finds free numbers
  std::filesystem::directory_iterator entry(name.folder, error);
  for (; !error && entry != std::filesystem::directory_iterator(); entry.increment(error))
    highest = std::max(highest, name.number_of(entry->path().filename().string()));
  return highest;
}

/// Renames only if the new name does not exist. Returns 0 or errno.
int rename_to_new(const std::filesystem::path& from, const std::filesystem::path& to) {
  if (::renameat2(AT_FDCWD, from.c_str(), AT_FDCWD, to.c_str(), RENAME_NOREPLACE) == 0) return 0;
  if (errno == EEXIST) return EEXIST;
  // File systems without this flag, mostly network ones, support links.
  if (::link(from.c_str(), to.c_str()) != 0) return errno;
  ::unlink(from.c_str());
  return 0;
}

class RemovedAtEnd {
 public:
  explicit RemovedAtEnd(std::filesystem::path path) : path_(std::move(path)) {}
  ~RemovedAtEnd() {
    if (!path_.empty()) ::unlink(path_.c_str());
  }
  RemovedAtEnd(const RemovedAtEnd&) = delete;
  RemovedAtEnd& operator=(const RemovedAtEnd&) = delete;
  void keep() { path_.clear(); }

 private:
  std::filesystem::path path_;
};

std::filesystem::path copy_beside(const std::filesystem::path& file) {
  const std::string text = read_text_file(file, kMaxFileBytes);
  const CopyName name(file);
  // The copy is written under a temporary name first, so that a numbered copy is always complete.
  static std::atomic<uint64_t> counter{0};
  const auto working =
      name.folder / fmt::format(".{}.copy-{}-{}", name.stem, ::getpid(), counter++);
  RemovedAtEnd removed(working);
  write_text_file(working, text);
  constexpr int kTries = 1000;  // other programs may take numbers too, but not forever
  uint64_t number = highest_number(name);
  for (int i = 0; i < kTries; ++i) {
    const std::filesystem::path copy = name.numbered(++number);
    const int error = rename_to_new(working, copy);
    if (error == 0) return copy;
    if (error != EEXIST)
      throw Error(ErrorKind::Failed, fmt::format("{}: cannot copy the old rig: {}", copy.string(),
                                                 std::generic_category().message(error)));
  }
  throw Error(ErrorKind::Failed, file.string() + ": no free number for a copy of the old rig",
              "move its old copies to another folder");
}

}  // namespace

std::filesystem::path save_with_history(const Rig& rig, const std::filesystem::path& file) {
  validate_rig(rig, file.string());
  std::error_code error;
  const auto status = std::filesystem::status(file, error);
  if (!std::filesystem::status_known(status))
    throw Error(ErrorKind::Failed, fmt::format("{}: {}", file.string(), error.message()));
  if (!std::filesystem::exists(status)) {
    save_rig(rig, file);
    return {};
  }
  const std::filesystem::path copy = copy_beside(file);
  RemovedAtEnd removed(copy);  // removes the copy if the file was not replaced
  save_rig(rig, file);
  removed.keep();
  return copy;
}

}  // namespace lenticule::optics
