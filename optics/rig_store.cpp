// SPDX-License-Identifier: Apache-2.0
#include "optics/rig_store.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <unistd.h>

#include <algorithm>
#include <atomic>
#include <cerrno>
#include <cstdint>
#include <cstdio>
#include <optional>
#include <string>
#include <string_view>
#include <system_error>
#include <utility>

#include "base/error.h"
#include "base/file.h"
#include "base/numbers.h"
#include "optics/rig_file.h"
#include "optics/trim.h"

namespace lenticule::optics {
namespace {

namespace fs = std::filesystem;

constexpr size_t kMaxFileBytes = 16U << 20;

/// CopyName holds "rig" and ".toml" of "rig.toml".
struct CopyName {
  fs::path folder;
  std::string stem;
  std::string extension;

  explicit CopyName(const fs::path& file)
      : folder(file.has_parent_path() ? file.parent_path() : fs::path(".")),
        stem(file.stem().string()),
        extension(file.extension().string()) {}

  [[nodiscard]] fs::path numbered(uint64_t number) const {
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
int rename_to_new(const fs::path& from, const fs::path& to) {
  if (::renameat2(AT_FDCWD, from.c_str(), AT_FDCWD, to.c_str(), RENAME_NOREPLACE) == 0) return 0;
  if (errno == EEXIST) return EEXIST;
  // File systems without this flag, mostly network ones, support links.
  if (::link(from.c_str(), to.c_str()) != 0) return errno;
  ::unlink(from.c_str());
  return 0;
}

class RemovedAtEnd {
 public:
  explicit RemovedAtEnd(fs::path path) : path_(std::move(path)) {}
  ~RemovedAtEnd() {
    if (!path_.empty()) ::unlink(path_.c_str());
  }
  RemovedAtEnd(const RemovedAtEnd&) = delete;
  RemovedAtEnd& operator=(const RemovedAtEnd&) = delete;
  void keep() { path_.clear(); }

 private:
  fs::path path_;
};

fs::path copy_beside(const fs::path& file) {
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
    const fs::path copy = name.numbered(++number);
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

fs::path save_with_history(const Rig& rig, const fs::path& file) {
  validate_rig(rig, file.string());
  std::error_code error;
  const auto status = std::filesystem::status(file, error);
  if (!std::filesystem::status_known(status))
    throw Error(ErrorKind::Failed, fmt::format("{}: {}", file.string(), error.message()));
  if (!std::filesystem::exists(status)) {
    save_rig(rig, file);
    return {};
  }
  const fs::path copy = copy_beside(file);
  RemovedAtEnd removed(copy);  // removes the copy if the file was not replaced
  save_rig(rig, file);
  removed.keep();
  return copy;
}

namespace {

std::string text_or_nothing(const fs::path& file) {
  std::error_code error;
  return fs::exists(file, error) ? read_text_file(file, kMaxFileBytes) : std::string();
}

/// Returns the texts of the rig and its trim.
std::string text_of(const fs::path& rig) {
  return read_text_file(rig, kMaxFileBytes) + "\n# trim\n" + text_or_nothing(trim_file_of(rig));
}

std::optional<TrimmedRig> valid(const fs::path& rig) {
  try {
    return load_rig_and_identity(rig);
  } catch (const Error&) {
    return std::nullopt;
  }
}

}  // namespace

RigStore::RigStore(fs::path given, fs::path copy)
    : given_(std::move(given)), copy_(std::move(copy)), made_from_(copy_) {
  made_from_.replace_extension(".given");
}

RigStore::Marks RigStore::glance() const {
  return {mark_of(given_), mark_of(trim_file_of(given_))};
}

fs::path RigStore::in_use() const {
  try {
    return text_or_nothing(made_from_) == text_of(given_) && valid(copy_) ? copy_ : given_;
  } catch (const Error&) {
    return given_;
  }
}

bool RigStore::update() {
  seen_ = glance();
  if (in_use() == copy_) return false;
  const std::string text = text_of(given_);
  const Rig rig = load_rig(given_);
  validate_rig(trimmed(rig, load_trim(given_)), given_.string());
  // Until the last line, the copy is not the one of this text, and is made again after a failure.
  if (!valid(copy_) || !(load_rig(copy_) == rig)) (void)save_with_history(rig, copy_);
  save_trim(load_trim(given_), copy_);
  write_text_file(made_from_, text);
  return true;
}

bool RigStore::update_if_edited() {
  return !(glance() == seen_) && update();
}

bool RigStore::differs() const {
  if (in_use() != copy_) return false;
  const auto given = valid(given_);
  const auto own = valid(copy_);
  return given && own && !(given->rig == own->rig);
}

}  // namespace lenticule::optics
