// SPDX-License-Identifier: Apache-2.0
// SequenceJoiner joins containers that are consecutive parts of one film (SequencePart) without
// decoding a frame. The film has the bytes that one SequenceWriter would have written.
//
// Only two things depend on the frames before a part: offsets, which are written anew, and bands of
// the part's first frame that have the pixels of the frame before. The film has these bands only
// once. They are found by the digests of their pixels, which the maker of each part states.
#pragma once

#include <fcntl.h>
#include <fmt/format.h>
#include <xxhash.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <condition_variable>
#include <cstdint>
#include <filesystem>
#include <limits>
#include <memory>
#include <mutex>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <system_error>
#include <thread>
#include <utility>
#include <vector>

#include "base/error_kinds.h"
#include "base/file.h"
#include "base/temporary.h"
#include "frames/frame.h"
#include "frames/sequence/sequence_format.h"

namespace lenticule::farm {

/// Returns the XXH3 of the pixels of each band that a container would have for the frame.
[[nodiscard]] inline std::vector<uint64_t> band_digests(const frames::FrameView& frame) {
  frames::FileHeader header;
  header.geometry = frame.geometry;
  header.band_rows = choose_band_rows(frame.geometry);
  std::vector<uint64_t> digests;
  for (int band = 0; band < header.bands(); ++band)
    digests.push_back(frames::checksum_of(
        frame.bytes.subspan(header.band_offset(band), header.band_bytes(band))));
  return digests;
}

inline constexpr size_t kPiece = size_t{1} << 20;  ///< bytes read at a time
inline constexpr uint64_t kAnySize = std::numeric_limits<uint64_t>::max();

/// RunningDigest computes a 128-bit XXH3 of bytes as they come.
class RunningDigest {
 public:
  RunningDigest() : state_(XXH3_createState(), XXH3_freeState) {
    if (!state_ || XXH3_128bits_reset(state_.get()) != XXH_OK) throw std::bad_alloc();
  }
  void add(std::span<const uint8_t> bytes) {
    XXH3_128bits_update(state_.get(), bytes.data(), bytes.size());
  }
  [[nodiscard]] std::string value() const {
    const XXH128_hash_t digest = XXH3_128bits_digest(state_.get());
    return fmt::format("{:016x}{:016x}", digest.high64, digest.low64);
  }

 private:
  std::unique_ptr<XXH3_state_t, decltype(&XXH3_freeState)> state_;
};

[[noreturn]] inline void refuse(const std::filesystem::path& file, const std::string& cause) {
  throw input_error("{}: {}", file.string(), cause);
}

/// Returns the 128-bit XXH3 of a file in 32 hexadecimal digits. Throws Error(Input).
[[nodiscard]] inline std::string digest_of_file(const std::filesystem::path& file) {
  const OpenedFile opened = open_regular_file(file, kAnySize);
  RunningDigest digest;
  std::vector<uint8_t> piece(std::min<uint64_t>(kPiece, opened.bytes));
  for (uint64_t at = 0; at < opened.bytes; at += piece.size()) {
    const auto bytes = std::span(piece).first(std::min<uint64_t>(piece.size(), opened.bytes - at));
    if (!frames::read_at(opened.descriptor.get(), at, bytes))
      refuse(file, "cannot read the whole file");
    digest.add(bytes);
  }
  return digest.value();
}

[[nodiscard]] inline std::string digest_of_text(std::string_view text) {
  RunningDigest digest;
  digest.add({reinterpret_cast<const uint8_t*>(text.data()), text.size()});
  return digest.value();
}

struct FilmPart {
  std::filesystem::path file;
  std::string digest;                   ///< digest_of_file()
  std::vector<uint64_t> first_bands{};  ///< band_digests() of the part's first and last frames
  std::vector<uint64_t> last_bands{};
};

inline constexpr size_t kBuffers = 8;                ///< pieces that are read ahead
inline constexpr size_t kDirect = size_t{64} << 10;  ///< bytes that are worth a write of their own
inline constexpr uint64_t kFlush = uint64_t{8}
                                   << 20;  ///< bytes after which the disk begins to write

/// Returns the first property in which a part differs from the film; null if there is none.
inline const char* difference(const frames::SequenceInfo& part, const frames::SequenceInfo& film) {
  if (part.geometry != film.geometry) return "frames of another size";
  if (part.kind != film.kind || part.views != film.views) return "another kind of frames";
  if (rig_of(part) != rig_of(film)) return "made for another rig";
  if (part.rate != film.rate) return "another frame rate";
  if (part.made_from != film.made_from) return "made from another scene";
  if (part.max_error != film.max_error) return "written with another largest error";
  if (part.software != film.software) return "written by another version";
  return nullptr;
}

inline constexpr uint64_t kAhead = uint64_t{32} << 20;  ///< bytes that the disk reads ahead

/// PartStream reads a part from its first byte to its last in a thread of its own, which also
/// computes the digest, so that the caller has only to write.
class PartStream {
 public:
  /// Lifetime: `buffers` must outlive the stream.
  PartStream(std::filesystem::path file, OpenedFile opened,
             std::vector<std::vector<uint8_t>>& buffers)
      : file_(std::move(file)),
        opened_(std::move(opened)),
        buffers_(buffers),
        thread_([this](const std::stop_token& stop) { read_all(stop); }) {}

  /// Returns the next bytes, at least one and at most `most`; they are valid until the next call.
  /// Returns none at the end of the file, or if it cannot be read.
  [[nodiscard]] std::span<const uint8_t> take(uint64_t most) {
    std::unique_lock lock(mutex_);
    if (rest_.empty() && taken_ < pieces_) {
      if (taken_ > 0) ++free_;
      changed_.notify_all();
      changed_.wait(lock, [&] { return read_ > taken_ || failed_; });
      if (read_ == taken_) return {};
      const uint64_t begin = taken_ * kPiece;
      rest_ = std::span(buffers_[taken_ % buffers_.size()])
                  .first(std::min<uint64_t>(kPiece, opened_.bytes - begin));
      ++taken_;
    }
    const auto bytes = rest_.first(std::min<uint64_t>(most, rest_.size()));
    rest_ = rest_.subspan(bytes.size());
    return bytes;
  }

  /// Returns the digest of the bytes. The last of them must have been taken.
  [[nodiscard]] std::string digest() {
    thread_.join();
    return digest_.value();
  }

 private:
  void read_all(const std::stop_token& stop) {
    for (uint64_t piece = 0; piece < pieces_; ++piece) {
      {
        std::unique_lock lock(mutex_);
        if (!changed_.wait(lock, stop, [&] { return free_ > 0; }) || stop.stop_requested()) return;
        --free_;
      }
      const uint64_t begin = piece * kPiece;
      ask_ahead(begin);
      const auto bytes = std::span(buffers_[piece % buffers_.size()])
                             .first(std::min<uint64_t>(kPiece, opened_.bytes - begin));
      const bool is_read = read_piece(begin, bytes);
      if (is_read) digest_.add(bytes);
      const std::lock_guard lock(mutex_);
      (is_read ? read_ : failed_) += 1;
      changed_.notify_all();
      if (!is_read) return;
    }
  }

  /// Lets the disk read ahead further than the kernel does by itself, so that it is never idle.
  void ask_ahead(uint64_t begin) {
    if (asked_ >= opened_.bytes || begin + kAhead / 2 < asked_) return;
    (void)::posix_fadvise(opened_.descriptor.get(), static_cast<off_t>(asked_),
                          static_cast<off_t>(begin + kAhead - asked_), POSIX_FADV_WILLNEED);
    asked_ = begin + kAhead;
  }

  /// Reads bytes. Opens the file again if a process on another node has renamed the same part to
  /// its name: a network file system then takes the opened file away. The digest covers the bytes
  /// of both.
  bool read_piece(uint64_t begin, std::span<uint8_t> to) {
    errno = 0;
    if (frames::read_at(opened_.descriptor.get(), begin, to)) return true;
    if (errno != ESTALE) return false;
    try {
      opened_.descriptor = open_regular_file(file_, kAnySize).descriptor;
    } catch (const Error&) {
      return false;
    }
    return frames::read_at(opened_.descriptor.get(), begin, to);
  }

  std::filesystem::path file_;
  OpenedFile opened_;
  std::vector<std::vector<uint8_t>>& buffers_;
  uint64_t pieces_ = (opened_.bytes + kPiece - 1) / kPiece;
  RunningDigest digest_;
  uint64_t asked_ = 0;               ///< bytes that the disk was asked for
  std::span<const uint8_t> rest_{};  ///< bytes of the piece taken last
  std::mutex mutex_;
  std::condition_variable_any changed_;
  uint64_t free_ = buffers_.size();  ///< buffers that the thread may fill
  uint64_t read_ = 0;                ///< pieces in buffers
  uint64_t taken_ = 0;               ///< pieces of which the caller has taken bytes
  uint64_t failed_ = 0;
  std::jthread thread_;  // last member: the thread uses everything above
};

/// PartReader parses a part while it is read.
class PartReader {
 public:
  PartReader(const std::filesystem::path& file, std::vector<std::vector<uint8_t>>& buffers)
      : file_(file) {
    OpenedFile opened = open_regular_file(file, kAnySize);
    bytes_ = opened.bytes;
    layout_ = frames::read_sequence_layout(opened.descriptor.get(), file.string());
    entries_.resize(static_cast<size_t>(layout_.header.bands()));
    table_.resize(layout_.header.table_bytes());
    if (!layout_.from_index) damaged("its index is missing or damaged");
    (void)::posix_fadvise(opened.descriptor.get(), 0, 0, POSIX_FADV_SEQUENTIAL);
    stream_.emplace(file, std::move(opened), buffers);
  }

  [[noreturn]] void damaged(const std::string& cause) const {
    refuse(file_, fmt::format("damaged: {}", cause));
  }
  [[nodiscard]] const frames::SequenceLayout& layout() const { return layout_; }
  [[nodiscard]] const std::vector<frames::BandEntry>& entries() const { return entries_; }

  /// Passes the next `bytes` bytes to `sink` in spans.
  void pass(uint64_t bytes, const auto& sink) {
    while (bytes > 0) {
      const std::span<const uint8_t> span = stream_->take(bytes);
      if (span.empty()) damaged("it ends too early");
      sink(span);
      position_ += span.size();
      bytes -= span.size();
    }
  }
  /// Reads the next bytes into `to`.
  void read(std::span<uint8_t> to) {
    auto next = to.begin();
    pass(to.size(),
         [&](std::span<const uint8_t> bytes) { next = std::ranges::copy(bytes, next).out; });
  }
  /// Drops the bytes before the offset.
  void skip_to(uint64_t offset) {
    pass(offset - std::min(offset, position_), [](std::span<const uint8_t>) {});
  }
  void skip_to_end() { skip_to(bytes_); }
  [[nodiscard]] std::string digest() { return stream_->digest(); }

  /// Reads the header and the table of a frame, which must begin here.
  void read_head(uint64_t frame) {
    if (layout_.frames[frame] != position_) damaged("bytes between frames");
    std::array<uint8_t, frames::kFrameHeaderBytes> head{};
    read(head);
    const auto parsed = frames::parse_frame_header(head, layout_.header.bands());
    read(table_);
    if (!parsed || parsed->number != frame || parsed->table_checksum != frames::checksum_of(table_))
      damaged(fmt::format("frame {}", frame));
    const std::vector<frames::BandEntry> before = entries_;
    uint64_t next = position_;
    for (size_t band = 0; band < entries_.size(); ++band) {
      const auto entry =
          frames::parse_band_entry(std::span(table_).subspan(band * frames::kBandEntryBytes));
      if (!entry || entry->bytes > layout_.header.band_bytes(static_cast<int>(band)))
        damaged(fmt::format("frame {}", frame));
      entries_[band] = *entry;
      // Either the next bytes of this frame, or what the frame before has.
      if (is_new(band)) {
        if (entry->offset != next) damaged(fmt::format("frame {}: order of bands", frame));
        next += entry->bytes;
      } else if (frame == 0 || entry->offset != before[band].offset ||
                 entry->checksum != before[band].checksum || entry->bytes != before[band].bytes) {
        damaged(fmt::format("frame {}: a band of an unknown frame", frame));
      }
    }
    if (next - position_ != parsed->payload_bytes) damaged(fmt::format("frame {}", frame));
  }
  /// Returns true if the payload of the band is in the frame whose head was read last.
  [[nodiscard]] bool is_new(size_t band) const { return entries_[band].offset >= position_; }

 private:
  std::filesystem::path file_;
  uint64_t bytes_ = 0;
  frames::SequenceLayout layout_;
  std::vector<frames::BandEntry> entries_;
  std::vector<uint8_t> table_;
  std::optional<PartStream> stream_;
  uint64_t position_ = 0;
};

/// SequenceJoiner writes to a temporary file beside the film, which finish() renames. Memory: some
/// MiB and eight bytes for each frame, for a film of any length.
///
/// Thread safety: one thread.
class SequenceJoiner {
 public:
  /// Throws Error(Failed) if the film cannot be written.
  SequenceJoiner(std::filesystem::path film, const frames::SequenceInfo& info)
      : film_(std::move(film)),
        info_(info),
        file_(film_),
        buffers_(kBuffers, std::vector<uint8_t>(kPiece)) {
    append_file_start(info_, header_, out_);
    end_ = out_.size();
    bands_.resize(static_cast<size_t>(header_.bands()));
  }

  [[nodiscard]] uint64_t frame_count() const { return frames_.size(); }
  /// Returns the size of the film, after finish() with its index.
  [[nodiscard]] uint64_t bytes_written() const { return end_; }

  /// Appends the frames of a finished container that continues the film. Throws Error(Input) that
  /// begins with the part's file if the part is damaged, was made with another rig, size or rate,
  /// or has other frames than the next ones; Error(Failed) if the film cannot be written. The film
  /// cannot be continued after an error.
  void append(const FilmPart& part) {
    PartReader reader(part.file, buffers_);
    const frames::SequenceLayout& layout = reader.layout();
    if (const char* other = difference(layout.info, info_)) refuse(part.file, other);
    if (layout.header.band_rows != header_.band_rows) refuse(part.file, "bands of another height");
    if (layout.info.first_frame != info_.first_frame + frame_count())
      refuse(part.file, fmt::format("begins with frame {}, not with frame {}",
                                    layout.info.first_frame, info_.first_frame + frame_count()));
    if (part.first_bands.size() != bands_.size() || part.last_bands.size() != bands_.size())
      refuse(part.file, "digests of another number of bands");
    if (frame_count() + layout.frames.size() > frames::kMaxSequenceFrames)
      throw failed_error("{}: full: {} frames are the limit", film_.string(),
                         frames::kMaxSequenceFrames);
    reader.skip_to(layout.header.data_begin());
    for (uint64_t frame = 0; frame < layout.frames.size(); ++frame)
      append_frame(reader, frame, part);
    reader.skip_to_end();
    if (reader.digest() != part.digest) reader.damaged("its bytes are not those that were written");
    last_digests_ = part.last_bands;
  }

  /// Writes the index and replaces the film. Throws Error(Failed).
  void finish() {
    frames::append_index(frames_, end_, out_);
    write_out();
    end_ = written_;
    file_.replace_target();
  }

 private:
  void append_frame(PartReader& part, uint64_t frame, const FilmPart& about) {
    part.read_head(frame);
    const uint64_t payload = end_ + frames::kFrameHeaderBytes + header_.table_bytes();
    uint64_t next = payload;
    std::vector<bool> fresh(bands_.size());
    std::vector<bool> copied(bands_.size());
    std::vector<uint8_t> table;
    for (size_t band = 0; band < bands_.size(); ++band) {
      fresh[band] = part.is_new(band);
      copied[band] = fresh[band] && (frame > 0 || !repeats(about, band));
      if (copied[band]) {
        bands_[band] = part.entries()[band];
        bands_[band].offset = next;
        next += bands_[band].bytes;
      }
      append_band_entry(bands_[band], table);
    }
    frames_.push_back(end_);
    frames::append_frame_header({.number = frames_.size() - 1,
                                 .payload_bytes = next - payload,
                                 .table_checksum = frames::checksum_of(table)},
                                header_.bands(), out_);
    out_.insert(out_.end(), table.begin(), table.end());
    for (size_t band = 0; band < bands_.size(); ++band) {
      if (!fresh[band]) continue;
      part.pass(part.entries()[band].bytes, [&](std::span<const uint8_t> bytes) {
        if (copied[band]) add(bytes);
      });
    }
    end_ = next;
  }
  [[nodiscard]] bool repeats(const FilmPart& about, size_t band) const {
    return !last_digests_.empty() && last_digests_[band] == about.first_bands[band];
  }
  void add(std::span<const uint8_t> bytes) {
    if (bytes.size() < kDirect) {
      out_.insert(out_.end(), bytes.begin(), bytes.end());
      if (out_.size() >= kPiece) write_out();
      return;
    }
    write_out();
    write(bytes);
  }
  void write_out() {
    write(out_);
    out_.clear();
  }
  void write(std::span<const uint8_t> bytes) {
    if (!frames::write_at(file_.fd(), written_, bytes))
      throw failed_error("{}: cannot write: {}", film_.string(),
                         std::generic_category().message(errno))
          .remedy(errno == ENOSPC || errno == EDQUOT ? "free some space, or write somewhere else"
                                                     : "");
    written_ += bytes.size();
    if (written_ - flushed_ < kFlush) return;
    // The disk begins now with what finish() waits for.
    (void)::sync_file_range(file_.fd(), static_cast<off_t>(flushed_),
                            static_cast<off_t>(written_ - flushed_), SYNC_FILE_RANGE_WRITE);
    flushed_ = written_;
  }

  std::filesystem::path film_;
  frames::SequenceInfo info_;
  frames::FileHeader header_;
  TemporaryFile file_;
  std::vector<uint64_t> frames_;
  std::vector<frames::BandEntry> bands_;       ///< bands of the film's last frame
  std::vector<uint64_t> last_digests_{};       ///< digests of the last part's last bands
  std::vector<uint8_t> out_;                   ///< bytes before end_ that are not yet written
  std::vector<std::vector<uint8_t>> buffers_;  ///< pieces of the part that is read ahead
  uint64_t written_ = 0;
  uint64_t flushed_ = 0;  ///< bytes that the disk was told to write
  uint64_t end_ = 0;
};

}  // namespace lenticule::farm
