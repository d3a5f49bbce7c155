// SPDX-License-Identifier: Apache-2.0
#include "display/scanout_recorder.h"

#include <fmt/format.h>
#include <unistd.h>
#include <xxhash.h>

#include <algorithm>
#include <cerrno>
#include <cstdio>
#include <cstring>
#include <exception>
#include <memory>
#include <new>
#include <system_error>
#include <utility>
#include <vector>

#include "base/error.h"
#include "display/scanout_format.h"
#include "frames/image_io.h"

namespace lenticule::display {
namespace {

namespace fs = std::filesystem;

[[noreturn]] void fail(const fs::path& file, int error) {
  throw Error(ErrorKind::Failed,
              fmt::format("{}: cannot write: {}", file.string(), std::strerror(error)),
              "record to a folder that exists, is writable and has room");
}

class ChecksumRecorder final : public ScanoutRecorder {
 public:
  explicit ChecksumRecorder(fs::path file)
      : file_(std::move(file)),
        partial_(file_.string() + fmt::format(".partial-{}", getpid())),
        stream_(std::fopen(partial_.c_str(), "we")) {
    if (stream_ == nullptr) fail(file_, errno);
    if (hash_ == nullptr) throw std::bad_alloc();
    // Anybody can check the figures: xxhsum -H1 on the raw RGB bytes.
    note(std::fputs("# vblank frame xxh64-of-rgb\n", stream_));
  }

  ~ChecksumRecorder() override {
    if (stream_ == nullptr) return;
    std::fclose(stream_);
    unlink(partial_.c_str());
  }
  ChecksumRecorder(const ChecksumRecorder&) = delete;
  ChecksumRecorder& operator=(const ChecksumRecorder&) = delete;

  void record(const ShownFrame& shown, const ScanoutView& scanout) noexcept override {
    if (error_ != 0) return;
    note_skipped(shown.skipped_before);
    note(std::fprintf(stream_, "%ju %ju %016jx\n", uintmax_t{shown.sequence}, uintmax_t{shown.id},
                      uintmax_t{checksum(scanout)}));
  }

  void finish() override {
    if (stream_ == nullptr) return;
    // After the last that was recorded; whoever calls record() need not count.
    note_skipped(std::max(skipped(), skipped_noted_) - skipped_noted_);
    std::FILE* const stream = std::exchange(stream_, nullptr);
    const bool flushed = std::fflush(stream) == 0;
    if (!flushed) note(-1);
    if (std::fclose(stream) != 0) note(-1);
    if (error_ == 0 && std::rename(partial_.c_str(), file_.c_str()) != 0) note(-1);
    if (error_ == 0) return;
    unlink(partial_.c_str());
    fail(file_, error_);
  }

 private:
  void note_skipped(uint64_t frames) noexcept {
    if (frames == 0) return;
    skipped_noted_ += frames;
    note(std::fprintf(stream_, "# %ju not recorded\n", uintmax_t{frames}));
  }

  void note(int written) noexcept {
    if (written < 0 && error_ == 0) error_ = errno != 0 ? errno : EIO;
  }

  uint64_t checksum(const ScanoutView& scanout) noexcept {
    row_.resize(scanout.geometry.row_bytes());
    XXH64_reset(hash_.get(), 0);
    for (int j = 0; j < scanout.geometry.height; ++j) {
      pack_row(scanout.row(j), row_.data(), static_cast<size_t>(scanout.geometry.width));
      XXH64_update(hash_.get(), row_.data(), row_.size());
    }
    return XXH64_digest(hash_.get());
  }

  fs::path file_;
  fs::path partial_;
  std::FILE* stream_;
  int error_ = 0;
  uint64_t skipped_noted_ = 0;
  std::vector<uint8_t> row_;
  std::unique_ptr<XXH64_state_t, decltype(&XXH64_freeState)> hash_{XXH64_createState(),
                                                                   &XXH64_freeState};
};

class PngRecorder final : public ScanoutRecorder {
 public:
  explicit PngRecorder(fs::path folder) : folder_(std::move(folder)) {
    std::error_code error;
    fs::create_directories(folder_, error);
    if (error) fail(folder_, error.value());
  }

  void record(const ShownFrame& shown, const ScanoutView& scanout) noexcept override {
    if (failure_) return;
    try {
      if (frame_.geometry() != scanout.geometry) frame_ = frames::WovenFrame(scanout.geometry);
      for (int j = 0; j < scanout.geometry.height; ++j)
        pack_row(scanout.row(j), frame_.row(j), static_cast<size_t>(scanout.geometry.width));
      frames::write_woven(frame_.view(), folder_ / fmt::format("{:08}.png", shown.id));
    } catch (...) {
      failure_ = std::current_exception();
    }
  }

  void finish() override {
    if (failure_) std::rethrow_exception(failure_);
  }

 private:
  fs::path folder_;
  frames::WovenFrame frame_;
  std::exception_ptr failure_;
};

}  // namespace

std::shared_ptr<ScanoutRecorder> open_recorder(std::string_view spec) {
  const size_t colon = spec.find(':');
  const std::string_view kind = spec.substr(0, colon);
  const std::string place(colon == std::string_view::npos ? "" : spec.substr(colon + 1));
  if (!place.empty() && kind == "checksums") return std::make_shared<ChecksumRecorder>(place);
  if (!place.empty() && kind == "png") return std::make_shared<PngRecorder>(place);
  throw Error(ErrorKind::Usage, fmt::format("recording '{}': not understood", spec),
              "write checksums:FILE or png:FOLDER");
}

}  // namespace lenticule::display
