// SPDX-License-Identifier: Apache-2.0
#include "apps/lenticule-web/api/photo_upload.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>

namespace lenticule::web {
namespace {

namespace fs = std::filesystem;

/// Returns the extension of a picture file by its first bytes, as the command expects it.
const char* extension_of(const fs::path& file) {
  const UniqueFd fd(::open(file.c_str(), O_RDONLY | O_CLOEXEC));
  unsigned char begin[4] = {};
  if (fd && ::read(fd.get(), begin, sizeof begin) == static_cast<ssize_t>(sizeof begin)) {
    if (std::memcmp(begin, "\x89PNG", 4) == 0) return ".png";
    if (std::memcmp(begin, "II*\0", 4) == 0 || std::memcmp(begin, "MM\0*", 4) == 0) return ".tif";
  }
  return ".jpg";
}

[[noreturn]] void fail_to_write() {
  throw HttpError(errno == ENOSPC || errno == EDQUOT ? 507 : 500,
                  fmt::format("photograph: cannot be written: {}", std::strerror(errno)));
}

}  // namespace

Claim::Claim(std::atomic<bool>& claimed) : claimed_(&claimed) {
  if (!claimed.exchange(true)) return;
  claimed_ = nullptr;
  throw HttpError(409, "a photograph is being judged, or sent", "try again in some seconds");
}

PhotoUpload::PhotoUpload(Claim claim, fs::path path, Judge judge)
    : claim_(std::move(claim)), path_(std::move(path)), judge_(std::move(judge)) {
  fs::create_directories(path_.parent_path());
  file_ =
      UniqueFd(::open(path_.c_str(), O_WRONLY | O_CREAT | O_TRUNC | O_CLOEXEC | O_NOFOLLOW, 0600));
  if (!file_) fail_to_write();
}

PhotoUpload::~PhotoUpload() {
  (void)::unlink(path_.c_str());
}

void PhotoUpload::take(std::span<const uint8_t> bytes) {
  while (!bytes.empty()) {
    const ssize_t written = ::write(file_.get(), bytes.data(), bytes.size());
    if (written < 0 && errno == EINTR) continue;
    if (written <= 0) fail_to_write();
    bytes = bytes.subspan(static_cast<size_t>(written));
  }
}

Response PhotoUpload::finish() {
  file_ = UniqueFd();
  fs::path named = path_;
  named.replace_extension(extension_of(path_));
  fs::rename(path_, named);
  path_ = named;
  return judge_(path_);
}

}  // namespace lenticule::web
