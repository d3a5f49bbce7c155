// SPDX-License-Identifier: Apache-2.0
#include "display/scanout_recorder.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <unistd.h>
#include <xxhash.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstdio>
#include <exception>
#include <new>
#include <system_error>
#include <utility>
#include <vector>

#include "base/error_kinds.h"
#include "base/temporary.h"
#include "base/unique_fd.h"
#include "display/scanout_format.h"
#include "frames/image_io.h"

namespace lenticule::display {
namespace {

namespace fs = std::filesystem;

[[noreturn]] void fail(const fs::path& file, const std::string& cause) {
  throw failed_error("{}: cannot write: {}", file.string(), cause)
      .remedy("record to a folder that exists, is writable and has free space");
}

std::string message_of(int error) { return std::generic_category().message(error); }

/// Throws Error(Failed) unless the whole recording is on the disk.
void require_whole(const fs::path& place, uint64_t lost, const std::string& reason) {
  if (lost > 0)
    fail(place, fmt::format("{}: {} displayed frames are missing",
                            reason.empty() ? "the disk was full for a while" : reason, lost));
  if (!reason.empty()) fail(place, reason);
}

/// FrameChecksum computes the XXH64 of displayed frames.
class FrameChecksum {
 public:
  FrameChecksum() {
    if (hash_ == nullptr) throw std::bad_alloc();
  }
  [[nodiscard]] uint64_t of(const ScanoutView& scanout) noexcept {
    row_.resize(scanout.geometry.row_bytes());
    XXH64_reset(hash_.get(), 0);
    const Isa isa = best_isa();
    for (int j = 0; j < scanout.geometry.height; ++j) {
      pack_row(scanout.depth, scanout.row(j), row_.data(),
               static_cast<size_t>(scanout.geometry.width), isa);
      XXH64_update(hash_.get(), row_.data(), row_.size());
    }
    return XXH64_digest(hash_.get());
  }

 private:
  std::vector<uint8_t> row_;
  std::unique_ptr<XXH64_state_t, decltype(&XXH64_freeState)> hash_{XXH64_createState(),
                                                                   &XXH64_freeState};
};

/// ChecksumRecorder writes a line per frame. Lines that the disk refuses wait in memory up to a
/// limit.
class ChecksumRecorder final : public ScanoutRecorder {
 public:
  explicit ChecksumRecorder(fs::path file) : file_(std::move(file)) {
    require_writable_place(file_);
    waiting_.reserve(kMostWaiting);
    // Users can check the figures with xxhsum -H1 on the raw RGB bytes.
    waiting_ = "# vblank frame xxh64-of-rgb\n";
    try_to_write();  // reports a write error at the start
  }

  void record(const ShownFrame& shown, const ScanoutView& scanout) noexcept override {
    unrecorded_ += shown.skipped_before;
    skips_noted_ += shown.skipped_before;
    std::array<char, kLongestLine> line{};
    const int length =
        std::snprintf(line.data(), line.size(), "%ju %ju %016jx\n", uintmax_t{shown.sequence},
                      uintmax_t{shown.id}, uintmax_t{checksum_.of(scanout)});
    if (!add({line.data(), static_cast<size_t>(length)})) {
      ++unrecorded_;
      count_lost(1);
    }
    if (waiting_.size() >= kWorthWriting && writes().due()) try_to_write();
  }

  void finish() override {
    if (std::exchange(finished_, true)) return;
    // Counts frames skipped after the last recorded one, which no later record() reports.
    unrecorded_ += std::max(skipped(), skips_noted_) - skips_noted_;
    if (unrecorded_ > 0) waiting_ += note_of(std::exchange(unrecorded_, 0));
    try_to_write();
    std::string reason = writes().state().reason;
    count_lost(leave_whole_lines());
    if (unfinished_.unfinished())
      if (const int error = unfinished_.keep()) reason = message_of(error);
    require_whole(file_, lost(), reason);
  }

 private:
  static constexpr size_t kLongestLine = 80;
  static constexpr size_t kWorthWriting = 4096;
  static constexpr size_t kMostWaiting = size_t{1} << 20;

  static std::string note_of(uint64_t frames) { return fmt::format("# {} not recorded\n", frames); }

  /// Adds a line. Returns false if there is no space for it and for the note that precedes it.
  bool add(std::string_view line) noexcept {
    if (waiting_.size() + 2 * kLongestLine > kMostWaiting) return false;
    if (unrecorded_ > 0) {
      std::array<char, kLongestLine> note{};
      const int length = std::snprintf(note.data(), note.size(), "# %ju not recorded\n",
                                       uintmax_t{std::exchange(unrecorded_, 0)});
      waiting_.append(note.data(), static_cast<size_t>(length));
    }
    waiting_.append(line);
    return true;
  }

  /// Writes the waiting lines, as far as the disk takes them.
  void try_to_write() noexcept {
    if (!unfinished_.unfinished()) errno = unfinished_.create(file_);
    const bool open = unfinished_.unfinished();
    size_t done = 0;
    while (open && done < waiting_.size()) {
      const ssize_t n = ::write(unfinished_.fd(), waiting_.data() + done, waiting_.size() - done);
      if (n < 0 && errno == EINTR) continue;
      if (n <= 0) break;
      done += static_cast<size_t>(n);
    }
    const bool all = open && done == waiting_.size();
    if (all)
      writes().succeeded();
    else
      writes().failed(strerrordesc_np(errno));
    const size_t line_end = waiting_.rfind('\n', done - 1);
    const bool has_line = done > 0 && line_end < done;
    torn_ = has_line ? done - line_end - 1 : torn_ + done;
    waiting_.erase(0, done);
  }

  /// Removes the beginning of a line from the file if the disk did not take its rest. Returns the
  /// number of frames whose lines are missing.
  uint64_t leave_whole_lines() noexcept {
    if (unfinished_.unfinished() && torn_ > 0 && !waiting_.empty()) {
      const off_t end = ::lseek(unfinished_.fd(), 0, SEEK_CUR);
      (void)!::ftruncate(unfinished_.fd(), end - static_cast<off_t>(torn_));
    }
    uint64_t frames = 0;
    for (size_t begin = 0; begin < waiting_.size();) {
      if (waiting_[begin] != '#') ++frames;
      begin = std::min(waiting_.find('\n', begin), waiting_.size() - 1) + 1;
    }
    return frames;
  }

  fs::path file_;
  TemporaryFile unfinished_;
  std::string waiting_;       ///< lines that are not written yet; the first may be partly written
  size_t torn_ = 0;           ///< bytes of a partly written line at the file's end
  uint64_t unrecorded_ = 0;   ///< frames to note before the next line
  uint64_t skips_noted_ = 0;  ///< part of skipped() that has been noted
  bool finished_ = false;
  FrameChecksum checksum_;
};

/// TimeRecorder writes each frame's line at once, into a file that has its name from the start.
class TimeRecorder final : public ScanoutRecorder {
 public:
  explicit TimeRecorder(fs::path file) : file_(std::move(file)) {
    require_writable_place(file_);  // a pipe without a reader would block
    out_ = UniqueFd(::open(file_.c_str(), O_WRONLY | O_CREAT | O_TRUNC | O_CLOEXEC, 0666));
    if (!out_) fail(file_, message_of(errno));
  }

  void record(const ShownFrame& shown, const ScanoutView& scanout) noexcept override {
    std::array<char, 96> line{};
    const int length = std::snprintf(
        line.data(), line.size(), "%ju %ju %016jx %jd\n", uintmax_t{shown.sequence},
        uintmax_t{shown.id}, uintmax_t{checksum_.of(scanout)}, intmax_t{shown.time.count()});
    if (::write(out_.get(), line.data(), static_cast<size_t>(length)) == length)
      return writes().succeeded();
    writes().failed(strerrordesc_np(errno));
    count_lost(1);
  }

  void finish() override { require_whole(file_, lost(), writes().state().reason); }

 private:
  fs::path file_;
  UniqueFd out_;
  FrameChecksum checksum_;
};

class PngRecorder final : public ScanoutRecorder {
 public:
  explicit PngRecorder(fs::path folder) : folder_(std::move(folder)) {
    std::error_code error;
    fs::create_directories(folder_, error);
    made_ = !error;
    if (made_) return;
    const bool disk = error == std::errc::no_space_on_device ||
                      error == std::errc::read_only_file_system ||
                      error == std::errc::permission_denied;
    if (!disk) fail(folder_, error.message());
    writes().failed(error.message().c_str());
  }

  void record(const ShownFrame& shown, const ScanoutView& scanout) noexcept override {
    if (!writes().due()) return count_lost(1);
    try {
      // The folder is created once: if it is removed during recording, it is not created again.
      if (!made_) made_ = fs::create_directories(folder_) || fs::is_directory(folder_);
      if (frame_.geometry() != scanout.geometry) frame_ = frames::WovenFrame(scanout.geometry);
      const Isa isa = best_isa();
      for (int j = 0; j < scanout.geometry.height; ++j)
        pack_row(scanout.depth, scanout.row(j), frame_.row(j),
                 static_cast<size_t>(scanout.geometry.width), isa);
      frames::write_woven(frame_.view(), folder_ / fmt::format("{:08}.png", shown.id));
      writes().succeeded();
    } catch (const std::exception& error) {
      writes().failed(error.what());
      count_lost(1);
    }
  }

  void finish() override { require_whole(folder_, lost(), writes().state().reason); }

 private:
  fs::path folder_;
  bool made_ = false;
  frames::WovenFrame frame_;
};

}  // namespace

std::shared_ptr<ScanoutRecorder> open_recorder(std::string_view spec) {
  const size_t colon = spec.find(':');
  const std::string_view kind = spec.substr(0, colon);
  const std::string place(colon == std::string_view::npos ? "" : spec.substr(colon + 1));
  if (!place.empty() && kind == "checksums") return std::make_shared<ChecksumRecorder>(place);
  if (!place.empty() && kind == "times") return std::make_shared<TimeRecorder>(place);
  if (!place.empty() && kind == "png") return std::make_shared<PngRecorder>(place);
  throw usage_error("recording '{}': not understood", spec)
      .remedy("write checksums:FILE, times:FILE or png:FOLDER");
}

}  // namespace lenticule::display
