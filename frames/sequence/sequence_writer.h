// SPDX-License-Identifier: Apache-2.0
// SequenceWriter writes a sequence container frame by frame. Until finish() the file is named
// FILE.part and contains every appended frame: if the process dies, only the frame in progress is
// lost, and writing can be resumed.
#pragma once

#include <fcntl.h>
#include <sys/file.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <chrono>
#include <cstdint>
#include <cstdlib>
#include <cstring>
#include <filesystem>
#include <optional>
#include <span>
#include <system_error>
#include <thread>
#include <vector>

#include "base/error_kinds.h"
#include "base/file.h"
#include "base/unique_fd.h"
#include "base/worker_threads.h"
#include "frames/frame.h"
#include "frames/sequence/band_codec.h"
#include "frames/sequence/sequence_format.h"
#include "frames/sequence/sequence_reader.h"

namespace lenticule::frames {

/// SequencePart is the place of a file in a longer film. With it, the file's frames have the bytes
/// that they have in the film, apart from offsets; SequenceJoiner joins such files.
struct SequencePart {
  uint64_t first = 0;  ///< index in the film of the file's first frame
  /// The choice of the film's frame `first - first % kPredictorInterval`; not used if that is the
  /// file's first frame.
  PredictorTable predictors{};
};

struct SequenceWriterOptions {
  /// Continue after the last whole frame of FILE.part, or of a finished FILE. The result has the
  /// same bytes as a file written in one run.
  bool resume = false;
  int threads = 0;  ///< compression threads; 0 means one per core
  /// Most code values, 0..kMostMaxError, by which a subpixel may be written wrong, to save space;
  /// SequenceInfo::max_error states it. A resumed file may have other bytes then, not larger
  /// errors.
  int max_error = 0;
  SequencePart part_of_film{};
};

/// SequenceWriter locks its file, so only one writer can have the file open.
///
/// Thread safety: one thread.
class SequenceWriter {
 public:
  /// Throws Error(Usage) for frames that a container cannot hold; Error(Failed) if the file cannot
  /// be written or another process is writing it; Error(Input) when the file to resume is not a
  /// sequence or was begun for another rig, size, rate or first frame.
  SequenceWriter(std::filesystem::path file, const SequenceInfo& info,
                 const SequenceWriterOptions& options = {})
      : file_(std::move(file)),
        part_(file_.string() + ".part"),
        part_of_film_(options.part_of_film),
        max_error_(options.max_error),
        workers_(options.threads) {
    LENTICULE_CHECK(max_error_ <= info.max_error);
    if (!can_hold(info.geometry))
      throw usage_error("{}: frames of {}x{} pixels are too large for a sequence container",
                        file_.string(), info.geometry.width, info.geometry.height);
    std::error_code ignored;
    const bool has_part = std::filesystem::exists(part_, ignored);
    const bool has_file = std::filesystem::exists(file_, ignored);
    if (options.resume && (has_part || has_file)) {
      continue_file(has_part ? part_ : file_, info);
    } else {
      if (has_part) open_and_lock(part_);  // no other process is writing the file
      begin(info);
    }
    for (int worker = 0; worker < workers_.count(); ++worker)
      coders_.emplace_back(layout_.header.band_bytes(0), max_error_);
    bands_.resize(static_cast<size_t>(layout_.header.bands()));
    recall();
    last_sync_ = std::chrono::steady_clock::now();
  }

  /// Returns the number of frames in the file, including frames of an earlier run.
  [[nodiscard]] uint64_t frame_count() const { return layout_.frames.size(); }
  [[nodiscard]] uint64_t bytes_written() const { return layout_.data_end; }

  /// Appends a frame. Throws Error(Failed), for example for a full disk: the file then ends with
  /// the previous frame, and appending may be retried.
  void append(const FrameView& frame) {
    LENTICULE_CHECK(!finished_ && frame.geometry == layout_.header.geometry &&
                    frame.bytes.size() == frame.geometry.frame_bytes());
    if (frame_count() == kMaxSequenceFrames)
      throw failed_error("{}: a sequence holds at most {} frames", part_.string(),
                         kMaxSequenceFrames);
    if (!in_step_) recall();
    in_step_ = false;  // if a step fails, the bands' entries belong to no frame in the file
    if ((part_of_film_.first + frame_count()) % kPredictorInterval == 0)
      predictors_ = choose_predictors(frame, layout_.header.band_rows);
    workers_.run(layout_.header.bands(),
                 [&](int band, int worker) { encode_band(frame, band, worker); });
    lay_out_record();
    if (!write_at(fd_.get(), layout_.data_end, record_)) cut_and_fail();
    layout_.frames.push_back(layout_.data_end);
    layout_.data_end += record_.size();
    previous_.assign(frame.bytes.begin(), frame.bytes.end());
    in_step_ = true;
    sync_now_and_then();
  }

  /// Writes the index and renames the file to its final name. Throws Error(Failed).
  void finish() {
    if (finished_) return;
    std::vector<uint8_t> bytes;
    append_index(layout_.frames, layout_.data_end, bytes);
    if (!write_at(fd_.get(), layout_.data_end, bytes) || ::fdatasync(fd_.get()) != 0)
      cut_and_fail();
    if (::rename(part_.c_str(), file_.c_str()) != 0) fail("cannot rename", errno);
    sync_folder_of(file_);
    finished_ = true;
  }

 private:
  /// Maximum loss by a power cut; a process that dies loses only the frame in progress.
  static constexpr std::chrono::seconds kSyncInterval{1};
  /// A power cut may damage the last frames, but not older ones.
  static constexpr uint64_t kFramesToCheck = 64;

  /// Returns the first property that differs and must be equal for frames in one file; null if
  /// there is none.
  static const char* difference(const SequenceInfo& there, const SequenceInfo& wanted) {
    if (there.geometry != wanted.geometry) return "another frame size";
    if (there.kind != wanted.kind || there.views != wanted.views) return "another kind of frames";
    if (there.rig_fingerprint != wanted.rig_fingerprint) return "another rig";
    if (there.rate != wanted.rate) return "another frame rate";
    if (there.first_frame != wanted.first_frame) return "another first frame";
    if (there.max_error != wanted.max_error) return "another largest error";
    if (there.made_from != wanted.made_from) return "another scene or input";
    return nullptr;
  }

  /// Counts the frames before the first one that is lost or, among the last ones, damaged.
  static uint64_t count_whole_frames(int fd, const SequenceLayout& layout) {
    const auto lost = std::find(layout.frames.begin(), layout.frames.end(), uint64_t{0});
    const auto count = static_cast<uint64_t>(lost - layout.frames.begin());
    FrameDecoder decoder(fd, layout);
    for (uint64_t frame = count - std::min(count, kFramesToCheck); frame < count; ++frame)
      if (!decoder.check(frame)) return frame;
    return count;
  }

  /// Returns the end of the file if only `count` of its frames are kept.
  static uint64_t end_of(int fd, const SequenceLayout& layout, uint64_t count) {
    if (count == 0) return layout.header.data_begin();
    std::vector<uint8_t> head(kFrameHeaderBytes);
    const uint64_t offset = layout.frames[count - 1];
    if (!read_at(fd, offset, head)) return layout.header.data_begin();
    const std::optional<FrameHeader> frame = parse_frame_header(head, layout.header.bands());
    LENTICULE_CHECK(frame.has_value());  // already checked above
    return offset + kFrameHeaderBytes + layout.header.table_bytes() + frame->payload_bytes;
  }
  struct Band {
    std::vector<uint8_t> payload;
    BandEntry entry;
    bool repeated = false;  ///< same pixels as in the previous frame, whose payload is referenced
  };
  /// Coders holds what a worker needs.
  struct Coders {
    Coders(size_t band_bytes, int max_error) : encoder(band_bytes, best_isa(), max_error) {
      if (max_error == 0) return;
      decoder.emplace(band_bytes);
      decoded.resize(band_bytes);
    }
    BandEncoder encoder;
    std::optional<BandDecoder> decoder;  ///< checks what was encoded with an error
    std::vector<uint8_t> decoded;
  };

  void begin(const SequenceInfo& info) {
    layout_.info = info;
    std::vector<uint8_t> bytes;
    append_file_start(info, layout_.header, bytes);
    if (layout_.header.metadata_bytes > kMaxMetadataBytes)
      throw usage_error("{}: metadata larger than {} MiB", file_.string(), kMaxMetadataBytes >> 20);
    // The temporary name comes first, so that an existing file has a whole header.
    write_file_atomically(part_, bytes);
    layout_.data_end = bytes.size();
    open_and_lock(part_);
  }
  void continue_file(const std::filesystem::path& there, const SequenceInfo& info) {
    open_and_lock(there);
    layout_ = read_sequence_layout(fd_.get(), there.string());
    if (const char* other = difference(layout_.info, info))
      throw input_error("{}: was started with {}", there.string(), other)
          .remedy("remove it, or write to another file");
    if (there != part_ && ::rename(there.c_str(), part_.c_str()) != 0)
      fail("cannot continue", errno);
    const uint64_t count = count_whole_frames(fd_.get(), layout_);
    layout_.data_end = end_of(fd_.get(), layout_, count);
    layout_.frames.resize(count);
    // This also removes the index: until a new one is written, readers find the frames without it.
    if (::ftruncate(fd_.get(), static_cast<off_t>(layout_.data_end)) != 0)
      fail("cannot truncate", errno);
  }
  void open_and_lock(const std::filesystem::path& there) {
    UniqueFd fd(::open(there.c_str(), O_RDWR | O_CLOEXEC | O_NONBLOCK | O_NOCTTY));
    if (!fd) fail("cannot open", errno);
    // A decoder that another thread is starting holds copies of our descriptors, and so the lock of
    // the temporary file, until it runs its own program.
    constexpr int kTries = 100;
    int tries = 0;
    while (::flock(fd.get(), LOCK_EX | LOCK_NB) != 0 && ++tries < kTries)
      std::this_thread::sleep_for(std::chrono::milliseconds(10));
    if (tries == kTries)
      throw failed_error("{}: another process is writing it", there.string())
          .remedy("wait for it, or choose another name");
    fd_ = std::move(fd);
  }
  void encode_band(const FrameView& frame, int index, int worker) {
    const size_t offset = layout_.header.band_offset(index);
    const size_t bytes = layout_.header.band_bytes(index);
    Band& band = bands_[static_cast<size_t>(index)];
    const std::span<const uint8_t> pixels = frame.bytes.subspan(offset, bytes);
    band.repeated =
        !previous_.empty() && std::memcmp(pixels.data(), &previous_[offset], bytes) == 0;
    if (band.repeated) return;
    Coders& coders = coders_[static_cast<size_t>(worker)];
    band.entry.codec = coders.encoder.encode(pixels, predictors_, band.payload);
    if (coders.decoder) require_small_errors(coders, band, pixels);
    band.entry.bytes = static_cast<uint32_t>(band.payload.size());
    band.entry.checksum = checksum_of(band.payload);
  }
  void require_small_errors(Coders& coders, const Band& band,
                            std::span<const uint8_t> pixels) const {
    const std::span<uint8_t> decoded = std::span(coders.decoded).first(pixels.size());
    LENTICULE_CHECK(coders.decoder->decode(band.entry.codec, band.payload, decoded));
    int largest = 0;
    for (size_t at = 0; at < pixels.size(); ++at)
      largest = std::max(largest, std::abs(pixels[at] - decoded[at]));
    LENTICULE_CHECK(largest <= max_error_);
  }
  /// Restores the state for encoding the next frame: the previous frame, the offsets of its bands,
  /// and the predictors. A resumed file therefore equals, byte by byte, a file written in one run.
  void recall() {
    in_step_ = true;
    previous_.clear();
    predictors_ = part_of_film_.predictors;
    if (frame_count() == 0) return;
    const uint64_t last = frame_count() - 1;
    const uint64_t since_choice = (part_of_film_.first + last) % kPredictorInterval;
    FrameDecoder decoder(fd_.get(), layout_);
    WovenFrame frame(layout_.header.geometry);
    std::vector<BandEntry> entries(bands_.size());
    std::vector<uint8_t> table(layout_.header.table_bytes());
    if (since_choice <= last) {
      in_step_ = decoder.decode(last - since_choice, frame.bytes());
      if (in_step_) predictors_ = choose_predictors(frame.view(), layout_.header.band_rows);
    }
    in_step_ = in_step_ && decoder.decode(last, frame.bytes()) &&
               read_band_table(fd_.get(), layout_, last, entries, table);
    if (!in_step_) throw failed_error("{}: frame {} cannot be read back", part_.string(), last);
    for (size_t band = 0; band < bands_.size(); ++band) bands_[band].entry = entries[band];
    previous_.assign(frame.bytes().begin(), frame.bytes().end());
  }
  void lay_out_record() {
    const FileHeader& header = layout_.header;
    const uint64_t payload = layout_.data_end + kFrameHeaderBytes + header.table_bytes();
    uint64_t position = payload;
    std::vector<uint8_t> table;
    for (Band& band : bands_) {
      if (!band.repeated) {
        band.entry.offset = position;
        position += band.entry.bytes;
      }
      append_band_entry(band.entry, table);
    }
    record_.clear();
    append_frame_header({.number = frame_count(),
                         .payload_bytes = position - payload,
                         .table_checksum = checksum_of(table)},
                        header.bands(), record_);
    record_.insert(record_.end(), table.begin(), table.end());
    for (const Band& band : bands_)
      if (!band.repeated) record_.insert(record_.end(), band.payload.begin(), band.payload.end());
  }
  void sync_now_and_then() {
    const auto now = std::chrono::steady_clock::now();
    if (now - last_sync_ < kSyncInterval) return;
    if (::fdatasync(fd_.get()) != 0) fail("cannot write", errno);
    last_sync_ = std::chrono::steady_clock::now();
  }
  /// Leaves the frames alone in the file after a failed write: if that fails too, resuming
  /// truncates the file.
  [[noreturn]] void cut_and_fail() const {
    const int error = errno;
    (void)!::ftruncate(fd_.get(), static_cast<off_t>(layout_.data_end));
    fail("cannot write", error);
  }
  [[noreturn]] void fail(const char* what, int error) const {
    throw failed_error("{}: {}: {}", part_.string(), what, std::generic_category().message(error));
  }

  std::filesystem::path file_;
  std::filesystem::path part_;
  SequencePart part_of_film_;
  UniqueFd fd_;
  SequenceLayout layout_;
  int max_error_;
  WorkerThreads workers_;
  std::vector<Coders> coders_;
  PredictorTable predictors_;
  std::vector<Band> bands_;
  std::vector<uint8_t> previous_;  ///< pixels of the last appended frame, empty at first
  std::vector<uint8_t> record_;
  bool in_step_ =
      false;  ///< predictors_, bands_ and previous_ belong to the last frame in the file
  std::chrono::steady_clock::time_point last_sync_;
  bool finished_ = false;
};

}  // namespace lenticule::frames
