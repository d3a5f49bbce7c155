// SPDX-License-Identifier: Apache-2.0
#include "frames/sequence/sequence_format.h"

#include <sys/stat.h>
#include <unistd.h>
#include <xxhash.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <limits>
#include <nlohmann/json.hpp>

#include "base/error_kinds.h"
#include "base/misnamed_file.h"
#include "optics/json_fields.h"

namespace lenticule::frames {
namespace {

using nlohmann::json;

using optics::JsonFields;

constexpr const char* kRemedy = "the file is damaged or was not written by lenticule";

Rate parse_sequence_rate(const JsonFields& fields) {
  const json& rate = fields.need("rate");
  if (!rate.is_array() || rate.size() != 2) fields.fail("rate", "not two numbers");
  constexpr uint64_t kMost = 1'000'000'000;
  const auto numerator = static_cast<int64_t>(fields.whole("rate", kMost, &rate[0]));
  const auto denominator = static_cast<int64_t>(fields.whole("rate", kMost, &rate[1]));
  try {
    return make_rate(numerator, denominator);
  } catch (const Error& error) {
    fields.fail("rate", error.what());
  }
}

SequenceViews parse_views(const JsonFields& all, const FrameGeometry& geometry) {
  const JsonFields fields(all.need("views"), all.source(), kRemedy);
  SequenceViews views;
  views.count = fields.count("count", kMaxSequenceViews);
  views.columns = fields.count("columns", kMaxSequenceViews);
  views.rows = fields.count("rows", kMaxSequenceViews);
  if (static_cast<int64_t>(views.columns) * views.rows < views.count ||
      views.columns > geometry.width || views.rows > geometry.height)
    all.fail("views", "the grid does not fit the views or the frame");
  const std::string order = fields.text_or("order", {});
  if (order != "left-to-right" && order != "right-to-left")
    all.fail("order", "neither left-to-right nor right-to-left");
  views.rightmost_first = order == "right-to-left";
  views.aspect = fields.number_or("aspect", 0.0, 0.0, 1e3);
  views.cone_degrees = fields.number_or("cone_degrees", 0.0, 0.0, 180.0);
  views.focus = fields.number_or("focus", 0.0, 0.0, 1e9);
  return views;
}

json views_json(const SequenceViews& views) {
  return {{"count", views.count},
          {"columns", views.columns},
          {"rows", views.rows},
          {"order", views.rightmost_first ? "right-to-left" : "left-to-right"},
          {"aspect", views.aspect},
          {"cone_degrees", views.cone_degrees},
          {"focus", views.focus}};
}

void parse_loop(const JsonFields& fields, SequenceInfo& info) {
  const json* loop = fields.find("loop");
  if (loop == nullptr) return;
  if (!loop->is_array() || loop->size() != 2) fields.fail("loop", "not two numbers");
  info.loop_begin = fields.whole("loop", kMaxSequenceFrames, &(*loop)[0]);
  if (!(*loop)[1].is_null()) info.loop_end = fields.whole("loop", kMaxSequenceFrames, &(*loop)[1]);
  if (info.loop_end && *info.loop_end <= info.loop_begin)
    fields.fail("loop", "ends before it begins");
}

void parse_rig_trim(const JsonFields& fields, SequenceInfo& info) {
  info.rig_calibration = fields.text_or("calibration", {});
  if (info.rig_calibration.empty()) return;
  constexpr double kOffset = optics::kMaxTrimOffsetLenses, kPitch = optics::kMaxTrimPitch;
  info.rig_trim = {.offset = Lenses(fields.number_or("offset_lenses", 0.0, -kOffset, kOffset)),
                   .pitch_relative = fields.number_or("pitch_relative", 0.0, -kPitch, kPitch)};
}

/// Reads or writes all bytes; `call` is pread() or pwrite().
template <class Byte>
bool move_all(auto call, int fd, uint64_t offset, std::span<Byte> bytes) noexcept {
  constexpr auto kMost = static_cast<uint64_t>(std::numeric_limits<off_t>::max());
  if (offset > kMost || bytes.size() > kMost - offset) {
    errno = EFBIG;
    return false;
  }
  while (!bytes.empty()) {
    const ssize_t count = call(fd, bytes.data(), bytes.size(), static_cast<off_t>(offset));
    if (count < 0 && errno == EINTR) continue;
    if (count <= 0) return false;
    bytes = bytes.subspan(static_cast<size_t>(count));
    offset += static_cast<uint64_t>(count);
  }
  return true;
}

// A non-text byte, the name, both kinds of line end, an end-of-file character: a program that
// treats the file as text damages the first bytes.
constexpr std::array<uint8_t, 8> kFileMagic = {0x89, 'L', 'T', 'S', '\r', '\n', 0x1a, '\n'};
constexpr std::array<uint8_t, 4> kFrameMagic = {'L', 'T', 'S', 'F'};
constexpr std::array<uint8_t, 8> kTrailerMagic = {'L', 'T', 'S', 'E', 'N', 'D', '\r', '\n'};
constexpr uint32_t kEndianTag = 0x01020304;
constexpr int kUsualBands = 36;
constexpr int kFewRows = 8;
constexpr const char* kRestore = "restore the file from a copy, or render it again";

void append_bytes(std::span<const uint8_t> bytes, std::vector<uint8_t>& to) {
  to.insert(to.end(), bytes.begin(), bytes.end());
}

bool begins_with(std::span<const uint8_t> bytes, std::span<const uint8_t> magic) {
  return bytes.size() >= magic.size() && std::equal(magic.begin(), magic.end(), bytes.begin());
}

/// Appends the checksum of the bytes since `begin`.
void append_checksum(size_t begin, std::vector<uint8_t>& to) {
  append_u64(to, checksum_of(std::span(to).subspan(begin)));
}

bool checksum_holds(std::span<const uint8_t> bytes, size_t at) {
  return load_u64(bytes.data() + at) == checksum_of(bytes.first(at));
}

bool in_range(const FileHeader& header) {
  if (!can_hold(header.geometry) || header.band_rows < 1) return false;
  if (header.band_rows > header.geometry.height) return false;
  return static_cast<uint32_t>(header.bands()) <= kMaxBands &&
         header.band_bytes(0) <= kMaxBandBytes;
}

constexpr size_t kOffsetBytes = 8;
constexpr size_t kSearchChunk = size_t{1} << 20;
/// Limits that stop the search in a file of many damaged frames.
constexpr int kMaxSearches = 64;
constexpr int kMaxFalseStarts = 4096;

[[noreturn]] void refuse(const std::string& source, const char* cause, const char* remedy) {
  throw input_error("{}: {}", source, cause).remedy(remedy);
}

FileHeader read_file_header(int fd, const std::string& source) {
  std::array<uint8_t, kFileHeaderBytes> bytes{};
  FileHeader header;
  const auto there = std::span(bytes).first(std::min(bytes.size(), size_t{size_of(fd)}));
  if (!read_at(fd, 0, there) || !begins_with(there, std::span(kFileMagic).first(4)))
    refuse_misnamed(fd, source);
  const HeaderFlaw flaw = parse_file_header(there, header);
  if (flaw.cause != nullptr) refuse(source, flaw.cause, flaw.remedy);
  return header;
}

SequenceInfo read_info(int fd, const FileHeader& header, uint64_t file_bytes,
                       const std::string& source) {
  if (header.metadata_bytes > kMaxMetadataBytes || header.data_begin() > file_bytes)
    refuse(source, "the file ends within its metadata", kRestore);
  std::vector<uint8_t> text(header.metadata_bytes);
  if (!read_at(fd, kFileHeaderBytes, text) || checksum_of(text) != header.metadata_checksum)
    refuse(source, "the metadata is damaged", kRestore);
  return parse_sequence_info({reinterpret_cast<const char*>(text.data()), text.size()},
                             header.geometry, source);
}

uint64_t least_frame_bytes(const FileHeader& header) {
  return kFrameHeaderBytes + header.table_bytes();
}

uint64_t most_frame_bytes(const FileHeader& header) {
  return least_frame_bytes(header) + header.geometry.frame_bytes();
}

/// Returns true if every offset is behind the one before, with space for a frame's header between
/// them.
bool offsets_make_sense(const std::vector<uint64_t>& frames, const FileHeader& header,
                        uint64_t end) {
  uint64_t earliest = header.data_begin();
  for (const uint64_t offset : frames) {
    if (offset < earliest || offset > end || end - offset < least_frame_bytes(header)) return false;
    earliest = offset + least_frame_bytes(header);
  }
  return true;
}

/// Returns true if the file has a whole index.
bool read_index(int fd, uint64_t file_bytes, SequenceLayout& layout) {
  if (file_bytes < layout.header.data_begin() + kTrailerBytes) return false;
  std::array<uint8_t, kTrailerBytes> bytes{};
  if (!read_at(fd, file_bytes - kTrailerBytes, bytes)) return false;
  const std::optional<Trailer> trailer = parse_trailer(bytes);
  if (!trailer || trailer->frame_count > kMaxSequenceFrames) return false;
  const uint64_t index_bytes = trailer->frame_count * kOffsetBytes;
  const uint64_t available = file_bytes - kTrailerBytes - layout.header.data_begin();
  if (index_bytes > available || trailer->index_offset != file_bytes - kTrailerBytes - index_bytes)
    return false;
  std::vector<uint8_t> index(index_bytes);
  if (!read_at(fd, trailer->index_offset, index) || checksum_of(index) != trailer->index_checksum)
    return false;
  layout.frames.resize(trailer->frame_count);
  for (size_t i = 0; i < layout.frames.size(); ++i)
    layout.frames[i] = load_u64(&index[i * kOffsetBytes]);
  layout.data_end = trailer->index_offset;
  return offsets_make_sense(layout.frames, layout.header, layout.data_end);
}

/// Returns true if the last frame is followed by an index that may be damaged or incomplete.
bool index_follows(int fd, uint64_t file_bytes, const SequenceLayout& layout) {
  const uint64_t index_bytes = layout.frames.size() * kOffsetBytes;
  const uint64_t rest = file_bytes - layout.data_end;
  if (rest == index_bytes + kTrailerBytes) return true;
  std::vector<uint8_t> index(std::min(rest, index_bytes));
  if (index.size() < kOffsetBytes || !read_at(fd, layout.data_end, index)) return false;
  for (size_t at = 0; at + kOffsetBytes <= index.size(); at += kOffsetBytes)
    if (load_u64(&index[at]) != layout.frames[at / kOffsetBytes]) return false;
  return true;
}

/// FrameSearch finds the frames of a file without their index.
class FrameSearch {
 public:
  FrameSearch(int fd, const FileHeader& header, uint64_t file_bytes)
      : fd_(fd), header_(header), file_bytes_(file_bytes) {}

  void run(SequenceLayout& layout) {
    uint64_t position = header_.data_begin();
    layout.data_end = position;
    while (layout.frames.size() < kMaxSequenceFrames) {
      std::optional<FrameHeader> frame = frame_at(position);
      if (!frame || frame->number != layout.frames.size())
        frame = next_frame(position, layout.frames.size());
      if (!frame) return;
      layout.frames.resize(frame->number, 0);  // the frames before this one are lost
      layout.frames.push_back(position);
      position += least_frame_bytes(header_) + frame->payload_bytes;
      layout.data_end = position;
    }
  }

 private:
  /// Returns the header of a frame that lies whole within the file.
  std::optional<FrameHeader> frame_at(uint64_t position) {
    std::array<uint8_t, kFrameHeaderBytes> bytes{};
    if (position > file_bytes_ || file_bytes_ - position < least_frame_bytes(header_))
      return std::nullopt;
    if (!read_at(fd_, position, bytes)) return std::nullopt;
    const std::optional<FrameHeader> frame = parse_frame_header(bytes, header_.bands());
    const uint64_t room = file_bytes_ - position - least_frame_bytes(header_);
    if (!frame || frame->payload_bytes > std::min<uint64_t>(room, header_.geometry.frame_bytes()))
      return std::nullopt;
    return frame;
  }

  /// Finds the next frame after a damaged one. A damaged frame is at most as long as the largest
  /// frame, which limits the distance to the next one.
  std::optional<FrameHeader> next_frame(uint64_t& position, uint64_t number) {
    if (++searches_ > kMaxSearches) return std::nullopt;
    const uint64_t end =
        std::min(file_bytes_, position + most_frame_bytes(header_) + frame_magic().size());
    for (uint64_t from = position + 1; from < end;) {
      const std::optional<uint64_t> found = find_magic(from, end);
      if (!found || ++false_starts_ > kMaxFalseStarts) return std::nullopt;
      const std::optional<FrameHeader> frame = frame_at(*found);
      if (frame && frame->number > number && frame->number - number <= kMaxSearches) {
        position = *found;
        return frame;
      }
      from = *found + 1;
    }
    return std::nullopt;
  }

  std::optional<uint64_t> find_magic(uint64_t from, uint64_t end) {
    const std::span<const uint8_t> magic = frame_magic();
    for (; from + magic.size() <= end; from += kSearchChunk) {
      chunk_.resize(std::min<uint64_t>(kSearchChunk + magic.size() - 1, end - from));
      if (!read_at(fd_, from, chunk_)) return std::nullopt;
      const auto at = std::search(chunk_.begin(), chunk_.end(), magic.begin(), magic.end());
      if (at != chunk_.end()) return from + static_cast<uint64_t>(at - chunk_.begin());
    }
    return std::nullopt;
  }

  int fd_;
  const FileHeader& header_;
  uint64_t file_bytes_;
  std::vector<uint8_t> chunk_;
  int searches_ = 0;
  int false_starts_ = 0;
};

/// Returns true if the band belongs to this frame or to an earlier one, and is no larger than its
/// pixels.
bool is_valid(const BandEntry& entry, const FileHeader& header, int band, uint64_t frame_end) {
  return entry.bytes >= 1 && entry.bytes <= header.band_bytes(band) &&
         entry.offset >= header.data_begin() && entry.offset <= frame_end &&
         frame_end - entry.offset >= entry.bytes;
}

}  // namespace

optics::RigIdentity rig_of(const SequenceInfo& info) {
  return {.fingerprint = info.rig_fingerprint,
          .calibration = info.rig_calibration.empty() ? info.rig_fingerprint : info.rig_calibration,
          .trim = info.rig_trim};
}

void state_rig(SequenceInfo& info, const optics::RigIdentity& rig) {
  info.rig_fingerprint = rig.fingerprint;
  info.rig_calibration = rig.trim.empty() ? std::string() : rig.calibration;
  info.rig_trim = rig.trim;
}

std::string sequence_info_to_json(const SequenceInfo& info) {
  json object = {{"kind", info.kind == SequenceKind::Woven ? "woven" : "views"},
                 {"rate", {info.rate.numerator, info.rate.denominator}},
                 {"first_frame", info.first_frame},
                 {"colour", info.kind == SequenceKind::Woven ? "panel" : "srgb"},
                 {"software", info.software}};
  object["loop"] =
      json::array({json(info.loop_begin), info.loop_end ? json(*info.loop_end) : json(nullptr)});
  if (!info.rig_fingerprint.empty()) object["rig_fingerprint"] = info.rig_fingerprint;
  if (!info.rig_toml.empty()) object["rig_toml"] = info.rig_toml;
  if (!info.rig_calibration.empty())
    object["rig_trim"] = {{"calibration", info.rig_calibration},
                          {"offset_lenses", info.rig_trim.offset.value},
                          {"pitch_relative", info.rig_trim.pitch_relative}};
  if (!info.made_from.empty()) object["made_from"] = info.made_from;
  if (info.max_error > 0) object["max_error"] = info.max_error;
  if (info.views) object["views"] = views_json(*info.views);
  return object.dump(1, ' ', false, json::error_handler_t::replace);
}

SequenceInfo parse_sequence_info(std::string_view text, const FrameGeometry& geometry,
                                 const std::string& source) {
  const json object = optics::parse_json(text, source + ": metadata", kRemedy);
  const JsonFields fields(object, source + ": metadata", kRemedy);
  SequenceInfo info;
  info.geometry = geometry;
  const std::string kind = fields.text_or("kind", {});
  if (kind != "woven" && kind != "views") fields.fail("kind", "neither woven nor views");
  info.kind = kind == "woven" ? SequenceKind::Woven : SequenceKind::Views;
  info.rate = parse_sequence_rate(fields);
  if (fields.find("first_frame") != nullptr)
    info.first_frame = fields.whole("first_frame", kMaxFirstFrame);
  parse_loop(fields, info);
  info.rig_fingerprint = fields.text_or("rig_fingerprint", {});
  info.rig_toml = fields.text_or("rig_toml", {});
  if (const json* trim = fields.find("rig_trim"))
    parse_rig_trim(JsonFields(*trim, fields.source(), kRemedy), info);
  info.made_from = fields.text_or("made_from", {});
  info.software = fields.text_or("software", {});
  if (fields.find("max_error") != nullptr)
    info.max_error = static_cast<int>(fields.whole("max_error", 255));
  if (info.kind == SequenceKind::Views) info.views = parse_views(fields, geometry);
  return info;
}

uint64_t size_of(int fd) noexcept {
  struct stat status {};
  return ::fstat(fd, &status) == 0 ? static_cast<uint64_t>(status.st_size) : 0;
}

bool read_at(int fd, uint64_t offset, std::span<uint8_t> to) noexcept {
  return move_all(::pread, fd, offset, to);
}

bool write_at(int fd, uint64_t offset, std::span<const uint8_t> from) noexcept {
  return move_all(::pwrite, fd, offset, from);
}

uint64_t checksum_of(std::span<const uint8_t> bytes) noexcept {
  return XXH3_64bits(bytes.data(), bytes.size());
}

int choose_band_rows(const FrameGeometry& geometry) {
  const int usual = (geometry.height + kUsualBands - 1) / kUsualBands;
  const auto most = static_cast<int>(kMaxBandBytes / std::max<size_t>(geometry.row_bytes(), 1));
  return std::clamp(usual, std::min(kFewRows, geometry.height),
                    std::max(1, std::min(most, geometry.height)));
}

bool can_hold(const FrameGeometry& geometry) {
  return geometry.width >= 1 && geometry.width <= kMaxSequencePixels && geometry.height >= 1 &&
         geometry.height <= kMaxSequencePixels && geometry.format == PixelFormat::Rgb8 &&
         geometry.frame_bytes() <= kMaxSequenceFrameBytes;
}

void append_file_header(const FileHeader& header, std::vector<uint8_t>& to) {
  const size_t begin = to.size();
  append_bytes(kFileMagic, to);
  append_u32(to, kSequenceVersion);
  append_u32(to, kEndianTag);
  append_u32(to, static_cast<uint32_t>(header.geometry.width));
  append_u32(to, static_cast<uint32_t>(header.geometry.height));
  append_u32(to, static_cast<uint32_t>(header.geometry.format));
  append_u32(to, static_cast<uint32_t>(header.band_rows));
  append_u64(to, header.metadata_bytes);
  append_u64(to, header.metadata_checksum);
  append_u64(to, 0);
  append_checksum(begin, to);
}

HeaderFlaw parse_file_header(std::span<const uint8_t> bytes, FileHeader& header) {
  constexpr HeaderFlaw kDamaged{"the header is damaged", kRestore};
  if (!begins_with(bytes, std::span(kFileMagic).first(4)))
    return {"not a sequence container", "use a file that lenticule wrote (.lts)"};
  if (bytes.size() < kFileHeaderBytes) return {"the file ends within its header", kRestore};
  if (!begins_with(bytes, kFileMagic)) return kDamaged;
  if (load_u32(&bytes[8]) != kSequenceVersion)
    return {"unsupported version of the sequence container",
            "use the version of lenticule that wrote it, or convert the file with that version"};
  if (!checksum_holds(bytes, kFileHeaderBytes - 8) || load_u32(&bytes[12]) != kEndianTag)
    return kDamaged;
  const auto number = [&](size_t at) { return static_cast<int>(load_u32(&bytes[at])); };
  header.geometry = {number(16), number(20), static_cast<PixelFormat>(number(24))};
  header.band_rows = number(28);
  header.metadata_bytes = load_u64(&bytes[32]);
  header.metadata_checksum = load_u64(&bytes[40]);
  if (in_range(header)) return {};
  return {"frame size not supported", "the limits are in docs/content/formats.md"};
}

void append_frame_header(const FrameHeader& header, int bands, std::vector<uint8_t>& to) {
  const size_t begin = to.size();
  append_bytes(kFrameMagic, to);
  append_u32(to, static_cast<uint32_t>(bands));
  append_u64(to, header.number);
  append_u64(to, header.payload_bytes);
  append_u64(to, header.table_checksum);
  append_checksum(begin, to);
}

std::optional<FrameHeader> parse_frame_header(std::span<const uint8_t> bytes, int bands) noexcept {
  if (bytes.size() < kFrameHeaderBytes || !begins_with(bytes, kFrameMagic) ||
      !checksum_holds(bytes, kFrameHeaderBytes - 8) ||
      load_u32(&bytes[4]) != static_cast<uint32_t>(bands))
    return std::nullopt;
  return FrameHeader{.number = load_u64(&bytes[8]),
                     .payload_bytes = load_u64(&bytes[16]),
                     .table_checksum = load_u64(&bytes[24])};
}

void append_band_entry(const BandEntry& entry, std::vector<uint8_t>& to) {
  append_u64(to, entry.offset);
  append_u32(to, entry.bytes);
  append_u32(to, static_cast<uint32_t>(entry.codec));
  append_u64(to, entry.checksum);
}

std::optional<BandEntry> parse_band_entry(std::span<const uint8_t> bytes) noexcept {
  const uint32_t codec = load_u32(&bytes[12]);
  if (codec >= kBandCodecs) return std::nullopt;
  return BandEntry{.offset = load_u64(bytes.data()),
                   .bytes = load_u32(&bytes[8]),
                   .codec = static_cast<BandCodec>(codec),
                   .checksum = load_u64(&bytes[16])};
}

void append_trailer(const Trailer& trailer, std::vector<uint8_t>& to) {
  const size_t begin = to.size();
  append_u64(to, trailer.index_offset);
  append_u64(to, trailer.frame_count);
  append_u64(to, trailer.index_checksum);
  append_checksum(begin, to);
  append_bytes(kTrailerMagic, to);
}

std::optional<Trailer> parse_trailer(std::span<const uint8_t> bytes) noexcept {
  if (bytes.size() < kTrailerBytes || !begins_with(bytes.subspan(32), kTrailerMagic) ||
      !checksum_holds(bytes, 24))
    return std::nullopt;
  return Trailer{.index_offset = load_u64(bytes.data()),
                 .frame_count = load_u64(&bytes[8]),
                 .index_checksum = load_u64(&bytes[16])};
}

std::span<const uint8_t> frame_magic() noexcept { return kFrameMagic; }

void append_file_start(const SequenceInfo& info, FileHeader& header, std::vector<uint8_t>& to) {
  const std::string metadata = sequence_info_to_json(info);
  header.geometry = info.geometry;
  header.band_rows = choose_band_rows(info.geometry);
  header.metadata_bytes = metadata.size();
  header.metadata_checksum =
      checksum_of({reinterpret_cast<const uint8_t*>(metadata.data()), metadata.size()});
  append_file_header(header, to);
  to.insert(to.end(), metadata.begin(), metadata.end());
}

void append_index(const std::vector<uint64_t>& frames, uint64_t data_end,
                  std::vector<uint8_t>& to) {
  std::vector<uint8_t> index;
  index.reserve(frames.size() * kOffsetBytes + kTrailerBytes);
  for (const uint64_t offset : frames) append_u64(index, offset);
  const Trailer trailer{
      .index_offset = data_end, .frame_count = frames.size(), .index_checksum = checksum_of(index)};
  append_trailer(trailer, index);
  to.insert(to.end(), index.begin(), index.end());
}

SequenceLayout read_sequence_layout(int fd, const std::string& source) {
  const uint64_t file_bytes = size_of(fd);
  SequenceLayout layout;
  layout.header = read_file_header(fd, source);
  layout.info = read_info(fd, layout.header, file_bytes, source);
  layout.from_index = layout.has_every_frame = read_index(fd, file_bytes, layout);
  if (layout.from_index) return layout;
  layout.frames.clear();
  FrameSearch(fd, layout.header, file_bytes).run(layout);
  layout.has_every_frame = index_follows(fd, file_bytes, layout);
  return layout;
}

bool read_band_table(int fd, const SequenceLayout& layout, uint64_t frame,
                     std::span<BandEntry> entries, std::span<uint8_t> scratch) noexcept {
  const FileHeader& header = layout.header;
  const uint64_t offset = layout.frames[frame];
  std::array<uint8_t, kFrameHeaderBytes> head{};
  if (offset == 0 || !read_at(fd, offset, head)) return false;
  const std::optional<FrameHeader> parsed = parse_frame_header(head, header.bands());
  if (!parsed || parsed->number != frame || parsed->payload_bytes > header.geometry.frame_bytes())
    return false;
  const std::span<uint8_t> table = scratch.first(header.table_bytes());
  if (!read_at(fd, offset + kFrameHeaderBytes, table)) return false;
  if (checksum_of(table) != parsed->table_checksum) return false;
  const uint64_t frame_end = offset + least_frame_bytes(header) + parsed->payload_bytes;
  for (int band = 0; band < header.bands(); ++band) {
    const auto at = static_cast<size_t>(band) * kBandEntryBytes;
    const std::optional<BandEntry> entry = parse_band_entry(table.subspan(at, kBandEntryBytes));
    if (!entry || !is_valid(*entry, header, band, frame_end)) return false;
    entries[static_cast<size_t>(band)] = *entry;
  }
  return true;
}

}  // namespace lenticule::frames
