// SPDX-License-Identifier: Apache-2.0
#include "frames/sequence/sequence_joiner.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <xxhash.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <limits>
#include <memory>
#include <span>
#include <system_error>

#include "base/error.h"
#include "base/file.h"
#include "frames/sequence/file_bytes.h"

namespace lenticule::frames {
namespace {

constexpr size_t kPiece = size_t{1} << 20;  ///< bytes read or written at a time
constexpr uint64_t kAnySize = std::numeric_limits<uint64_t>::max();

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

[[noreturn]] void refuse(const std::filesystem::path& file, const std::string& cause) {
  throw Error(ErrorKind::Input, fmt::format("{}: {}", file.string(), cause));
}

/// Returns the first property in which a part differs from the film; null if there is none.
const char* difference(const SequenceInfo& part, const SequenceInfo& film) {
  if (part.geometry != film.geometry) return "frames of another size";
  if (part.kind != film.kind || part.views != film.views) return "another kind of frames";
  if (rig_of(part) != rig_of(film)) return "made for another rig";
  if (part.rate != film.rate) return "another frame rate";
  if (part.made_from != film.made_from) return "made from another scene";
  if (part.software != film.software) return "written by another version";
  return nullptr;
}

}  // namespace

std::vector<uint64_t> band_digests(const FrameView& frame) {
  FileHeader header;
  header.geometry = frame.geometry;
  header.band_rows = choose_band_rows(frame.geometry);
  std::vector<uint64_t> digests;
  for (int band = 0; band < header.bands(); ++band)
    digests.push_back(
        checksum_of(frame.bytes.subspan(header.band_offset(band), header.band_bytes(band))));
  return digests;
}

std::string digest_of_text(std::string_view text) {
  RunningDigest digest;
  digest.add({reinterpret_cast<const uint8_t*>(text.data()), text.size()});
  return digest.value();
}

std::string digest_of_file(const std::filesystem::path& file) {
  const OpenedFile opened = open_regular_file(file, kAnySize);
  RunningDigest digest;
  std::vector<uint8_t> piece(std::min<uint64_t>(kPiece, opened.bytes));
  for (uint64_t at = 0; at < opened.bytes; at += piece.size()) {
    const auto bytes = std::span(piece).first(std::min<uint64_t>(piece.size(), opened.bytes - at));
    if (!read_at(opened.descriptor.get(), at, bytes)) refuse(file, "cannot read the whole file");
    digest.add(bytes);
  }
  return digest.value();
}

/// PartReader reads a part from its first byte to its last, and computes its digest meanwhile.
class SequenceJoiner::PartReader {
 public:
  explicit PartReader(const std::filesystem::path& file)
      : file_(file),
        opened_(open_regular_file(file, kAnySize)),
        layout_(read_sequence_layout(opened_.descriptor.get(), file.string())),
        entries_(static_cast<size_t>(layout_.header.bands())),
        table_(layout_.header.table_bytes()) {
    (void)::posix_fadvise(opened_.descriptor.get(), 0, 0, POSIX_FADV_SEQUENTIAL);
    if (!layout_.from_index) damaged("its index is missing or damaged");
  }

  [[noreturn]] void damaged(const std::string& cause) const {
    refuse(file_, fmt::format("damaged: {}", cause));
  }
  [[nodiscard]] const SequenceLayout& layout() const { return layout_; }
  [[nodiscard]] const std::vector<BandEntry>& entries() const { return entries_; }

  /// Reads the next bytes into `to`.
  void read(std::span<uint8_t> to) {
    errno = 0;
    if (!read_at(opened_.descriptor.get(), position_, to) && !read_again(to))
      damaged("it ends too early");
    digest_.add(to);
    position_ += to.size();
  }
  /// Reads up to the offset and drops the bytes.
  void skip_to(uint64_t offset) {
    std::vector<uint8_t> piece(std::min<uint64_t>(kPiece, offset - std::min(offset, position_)));
    while (position_ < offset)
      read(std::span(piece).first(std::min<uint64_t>(piece.size(), offset - position_)));
  }
  void skip_to_end() { skip_to(opened_.bytes); }
  [[nodiscard]] std::string digest() const { return digest_.value(); }

  /// Reads the header and the table of a frame, which must begin here.
  void read_head(uint64_t frame) {
    if (layout_.frames[frame] != position_) damaged("bytes between frames");
    std::array<uint8_t, kFrameHeaderBytes> head{};
    read(head);
    const auto parsed = parse_frame_header(head, layout_.header.bands());
    read(table_);
    if (!parsed || parsed->number != frame || parsed->table_checksum != checksum_of(table_))
      damaged(fmt::format("frame {}", frame));
    const std::vector<BandEntry> before = entries_;
    uint64_t next = position_;
    for (size_t band = 0; band < entries_.size(); ++band) {
      const auto entry = parse_band_entry(std::span(table_).subspan(band * kBandEntryBytes));
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
  /// Opens the file again if a process on another node has renamed the same part to its name: a
  /// network file system then takes the opened file away. The digest covers the bytes of both.
  bool read_again(std::span<uint8_t> to) {
    if (errno != ESTALE) return false;
    opened_ = open_regular_file(file_, kAnySize);
    return read_at(opened_.descriptor.get(), position_, to);
  }

  std::filesystem::path file_;
  OpenedFile opened_;
  SequenceLayout layout_;
  std::vector<BandEntry> entries_;
  std::vector<uint8_t> table_;
  RunningDigest digest_;
  uint64_t position_ = 0;
};

SequenceJoiner::SequenceJoiner(std::filesystem::path film, const SequenceInfo& info)
    : film_(std::move(film)), info_(info), file_(film_) {
  append_file_start(info_, header_, out_);
  end_ = out_.size();
  bands_.resize(static_cast<size_t>(header_.bands()));
}

SequenceJoiner::~SequenceJoiner() = default;

void SequenceJoiner::append(const FilmPart& part) {
  PartReader reader(part.file);
  const SequenceLayout& layout = reader.layout();
  if (const char* other = difference(layout.info, info_)) refuse(part.file, other);
  if (layout.header.band_rows != header_.band_rows) refuse(part.file, "bands of another height");
  if (layout.info.first_frame != info_.first_frame + frame_count())
    refuse(part.file, fmt::format("begins with frame {}, not with frame {}",
                                  layout.info.first_frame, info_.first_frame + frame_count()));
  if (part.first_bands.size() != bands_.size() || part.last_bands.size() != bands_.size())
    refuse(part.file, "digests of another number of bands");
  if (frame_count() + layout.frames.size() > kMaxSequenceFrames)
    throw Error(ErrorKind::Failed, fmt::format("{}: full: {} frames are the limit", film_.string(),
                                               kMaxSequenceFrames));
  reader.skip_to(layout.header.data_begin());
  for (uint64_t frame = 0; frame < layout.frames.size(); ++frame) append_frame(reader, frame, part);
  reader.skip_to_end();
  if (reader.digest() != part.digest) reader.damaged("its bytes are not those that were written");
  last_digests_ = part.last_bands;
}

bool SequenceJoiner::repeats(const FilmPart& about, size_t band) const {
  return !last_digests_.empty() && last_digests_[band] == about.first_bands[band];
}

void SequenceJoiner::append_frame(PartReader& part, uint64_t frame, const FilmPart& about) {
  part.read_head(frame);
  const uint64_t payload = end_ + kFrameHeaderBytes + header_.table_bytes();
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
  append_frame_header({.number = frames_.size() - 1,
                       .payload_bytes = next - payload,
                       .table_checksum = checksum_of(table)},
                      header_.bands(), out_);
  out_.insert(out_.end(), table.begin(), table.end());
  for (size_t band = 0; band < bands_.size(); ++band) {
    if (!fresh[band]) continue;
    const size_t bytes = part.entries()[band].bytes;
    const size_t begin = out_.size();
    out_.resize(begin + bytes);
    part.read(std::span(out_).subspan(begin));
    if (!copied[band]) out_.resize(begin);
    if (out_.size() >= kPiece) write_out();
  }
  end_ = next;
}

void SequenceJoiner::write_out() {
  if (!write_at(file_.fd(), written_, out_))
    throw Error(
        ErrorKind::Failed,
        fmt::format("{}: cannot write: {}", film_.string(), std::generic_category().message(errno)),
        errno == ENOSPC || errno == EDQUOT ? "free some space, or write somewhere else" : "");
  // The disk begins now with what finish() waits for.
  (void)::sync_file_range(file_.fd(), static_cast<off_t>(written_), static_cast<off_t>(out_.size()),
                          SYNC_FILE_RANGE_WRITE);
  written_ += out_.size();
  out_.clear();
}

void SequenceJoiner::finish() {
  append_index(frames_, end_, out_);
  write_out();
  end_ = written_;
  file_.replace_target();
}

}  // namespace lenticule::frames
