// SPDX-License-Identifier: Apache-2.0
#include "optics/rig_store.h"

#include <optional>
#include <string>
#include <utility>

#include "base/error.h"
#include "base/file.h"
#include "optics/rig_file.h"
#include "optics/rig_history.h"
#include "optics/trim.h"

namespace lenticule::optics {
namespace {

namespace fs = std::filesystem;

constexpr size_t kMaxFileBytes = 16U << 20;

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
