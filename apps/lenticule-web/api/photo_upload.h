// SPDX-License-Identifier: Apache-2.0
// PhotoUpload writes a photograph that arrives to a file, which is then judged.
#pragma once

#include <atomic>
#include <filesystem>
#include <functional>
#include <utility>

#include "apps/lenticule-web/http/message.h"
#include "base/unique_fd.h"

namespace lenticule::web {

/// Claim marks work that only one thread may do at a time.
class Claim {
 public:
  /// Throws HttpError 409 if another thread does it.
  explicit Claim(std::atomic<bool>& claimed);
  Claim(Claim&& other) noexcept : claimed_(std::exchange(other.claimed_, nullptr)) {}
  Claim& operator=(Claim&&) = delete;
  ~Claim() {
    if (claimed_ != nullptr) claimed_->store(false);
  }

 private:
  std::atomic<bool>* claimed_;
};

/// PhotoUpload keeps its claim until it is destroyed, and then removes its file, unless `judge`
/// moved the file elsewhere.
class PhotoUpload final : public BodySink {
 public:
  /// Takes the whole photograph, whose file has the extension of its format, and returns the
  /// answer.
  using Judge = std::function<Response(const std::filesystem::path& file)>;

  /// `path` has no extension; its folder is made. Throws HttpError 500 or 507 if the file cannot be
  /// written.
  PhotoUpload(Claim claim, std::filesystem::path path, Judge judge);
  ~PhotoUpload() override;

  void take(std::span<const uint8_t> bytes) override;
  Response finish() override;

 private:
  const Claim claim_;
  std::filesystem::path path_;
  UniqueFd file_;
  const Judge judge_;
};

}  // namespace lenticule::web
