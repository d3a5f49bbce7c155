// SPDX-License-Identifier: Apache-2.0
// Reads and writes the fixed parts of a sequence container as bytes. docs/content/formats.md
// specifies them.
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "frames/frame.h"
#include "frames/rational.h"
#include "frames/sequence/band_codec.h"
#include "optics/trim.h"

namespace lenticule::frames {

// SequenceInfo holds the metadata of a sequence container, stored as JSON: docs/content/formats.md
// has the keys.

enum class SequenceKind {
  Woven,  ///< the pixels of one panel, made for one rig
  Views,  ///< every frame is a grid of views, woven during playback
};

/// SequenceViews describes the tiles of views in a frame and the cameras of the views. Tile 0 is
/// the bottom-left one; the next tiles are to its right, then row by row upward, as in a quilt.
struct SequenceViews {
  int count = 0;
  int columns = 0;
  int rows = 0;
  bool rightmost_first = false;  ///< view 0 belongs to the rightmost camera
  double aspect = 0.0;           ///< width / height of a view as displayed
  double cone_degrees =
      0.0;             ///< angle between the outermost cameras, seen from the focus; 0 unknown
  double focus = 0.0;  ///< distance of the plane that appears on the panel; 0 unknown
  friend bool operator==(const SequenceViews&, const SequenceViews&) = default;
};

struct SequenceInfo {
  SequenceKind kind = SequenceKind::Woven;
  FrameGeometry geometry;
  Rate rate;
  uint64_t first_frame = 0;  ///< number of frame 0 in the numbering of the rendering
  /// Frames [loop_begin, loop_end) repeat; without loop_end up to the last frame.
  uint64_t loop_begin = 0;
  std::optional<uint64_t> loop_end;
  /// Fingerprint and whole file of the rig that a woven sequence was made for.
  std::string rig_fingerprint;
  std::string rig_toml;
  /// If the rig is trimmed: the fingerprint without the trim, and the trim. Empty otherwise.
  std::string rig_calibration;
  optics::Trim rig_trim;
  /// Scene or input that the frames were made from: its name and the folder's name. Empty: not
  /// stated.
  std::string made_from;
  int max_error =
      0;  ///< most code values by which a subpixel may differ from the original; 0: none
  std::optional<SequenceViews> views;  ///< set in a sequence of views
  std::string software;                ///< program that wrote the sequence
  friend bool operator==(const SequenceInfo&, const SequenceInfo&) = default;
};

inline constexpr size_t kMaxMetadataBytes = size_t{4} << 20;
inline constexpr int kMaxSequenceViews = 1024;

/// Return the members about the rig as one identity, and set them from one.
[[nodiscard]] optics::RigIdentity rig_of(const SequenceInfo& info);
void state_rig(SequenceInfo& info, const optics::RigIdentity& rig);

/// Returns the JSON of all members except the geometry, which the file's header contains.
[[nodiscard]] std::string sequence_info_to_json(const SequenceInfo& info);

/// Parses the metadata. Throws Error(Input) that begins with `source` for invalid JSON, missing
/// keys and values out of range. Ignores unknown keys: later versions may add some.
[[nodiscard]] SequenceInfo parse_sequence_info(std::string_view json, const FrameGeometry& geometry,
                                               const std::string& source);

// Reads and writes integers as little-endian bytes, on machines of any byte order.

[[nodiscard]] inline uint64_t load_little(const uint8_t* from, int bytes) noexcept {
  uint64_t value = 0;
  for (int i = bytes - 1; i >= 0; --i) value = value << 8 | from[i];
  return value;
}
[[nodiscard]] inline uint32_t load_u32(const uint8_t* from) noexcept {
  return static_cast<uint32_t>(load_little(from, 4));
}
[[nodiscard]] inline uint64_t load_u64(const uint8_t* from) noexcept {
  return load_little(from, 8);
}

inline void append_little(std::vector<uint8_t>& to, uint64_t value, int bytes) {
  for (int i = 0; i < bytes; ++i) to.push_back(static_cast<uint8_t>(value >> 8 * i));
}
inline void append_u32(std::vector<uint8_t>& to, uint32_t value) { append_little(to, value, 4); }
inline void append_u64(std::vector<uint8_t>& to, uint64_t value) { append_little(to, value, 8); }

// Reads and writes whole byte ranges of a file at 64-bit offsets.

/// Returns the size of an open file; 0 if the size is unknown.
[[nodiscard]] uint64_t size_of(int fd) noexcept;

/// Returns false at the end of the file and for errors; `to` is undefined then.
[[nodiscard]] bool read_at(int fd, uint64_t offset, std::span<uint8_t> to) noexcept;

/// Returns false if not all bytes could be written; errno has the cause.
[[nodiscard]] bool write_at(int fd, uint64_t offset, std::span<const uint8_t> from) noexcept;

inline constexpr uint32_t kSequenceVersion = 1;
inline constexpr size_t kFileHeaderBytes = 64;
inline constexpr size_t kFrameHeaderBytes = 40;
inline constexpr size_t kBandEntryBytes = 24;
inline constexpr size_t kTrailerBytes = 40;

// Limits of every file, checked before memory is allocated for the file.
inline constexpr int kMaxSequencePixels = 32768;  ///< limit per side
inline constexpr uint64_t kMaxSequenceFrameBytes = uint64_t{3} << 28;
inline constexpr uint64_t kMaxBandBytes = uint64_t{1} << 24;
inline constexpr uint32_t kMaxBands = 1024;
inline constexpr uint64_t kMaxSequenceFrames = uint64_t{1} << 24;
inline constexpr uint64_t kMaxFirstFrame = 1'000'000'000;

/// Returns the 64-bit XXH3 without a seed.
[[nodiscard]] uint64_t checksum_of(std::span<const uint8_t> bytes) noexcept;

struct FileHeader {
  FrameGeometry geometry;
  int band_rows = 0;
  uint64_t metadata_bytes = 0;
  uint64_t metadata_checksum = 0;

  [[nodiscard]] int bands() const { return (geometry.height + band_rows - 1) / band_rows; }
  /// Returns the band's offset in the frame. The last band may have fewer rows.
  [[nodiscard]] size_t band_offset(int band) const {
    return geometry.row_bytes() * static_cast<size_t>(band) * static_cast<size_t>(band_rows);
  }
  [[nodiscard]] size_t band_bytes(int band) const {
    const size_t begin = band_offset(band);
    const size_t whole = geometry.row_bytes() * static_cast<size_t>(band_rows);
    return begin + whole < geometry.frame_bytes() ? whole : geometry.frame_bytes() - begin;
  }
  [[nodiscard]] size_t table_bytes() const {
    return static_cast<size_t>(bands()) * kBandEntryBytes;
  }
  [[nodiscard]] uint64_t data_begin() const { return kFileHeaderBytes + metadata_bytes; }
};

struct BandEntry {
  uint64_t offset =
      0;  ///< offset in the file; an earlier frame's payload if the band did not change
  uint32_t bytes = 0;
  BandCodec codec = BandCodec::Raw;
  uint64_t checksum = 0;  ///< checksum of the payload
};

/// FrameHeader precedes a frame's band table and payload.
struct FrameHeader {
  uint64_t number = 0;         ///< 0 for the first frame of the file
  uint64_t payload_bytes = 0;  ///< bytes after the table
  uint64_t table_checksum = 0;
};

/// Trailer is at the very end of a finished file, after the index, which has one offset per frame.
struct Trailer {
  uint64_t index_offset = 0;
  uint64_t frame_count = 0;
  uint64_t index_checksum = 0;
};

/// Returns the number of rows per band that gives about 36 bands, within the format's limits.
[[nodiscard]] int choose_band_rows(const FrameGeometry& geometry);

/// Returns true if a container can hold frames of this geometry.
[[nodiscard]] bool can_hold(const FrameGeometry& geometry);

void append_file_header(const FileHeader& header, std::vector<uint8_t>& to);
void append_frame_header(const FrameHeader& header, int bands, std::vector<uint8_t>& to);
void append_band_entry(const BandEntry& entry, std::vector<uint8_t>& to);
void append_trailer(const Trailer& trailer, std::vector<uint8_t>& to);

struct HeaderFlaw {
  const char* cause = nullptr;  ///< null: none
  const char* remedy = nullptr;
};

/// Parses the first kFileHeaderBytes of a file, or all that it has.
[[nodiscard]] HeaderFlaw parse_file_header(std::span<const uint8_t> bytes, FileHeader& header);
/// Parses a header of kFrameHeaderBytes. Returns nothing unless it is a whole header for `bands`
/// bands.
[[nodiscard]] std::optional<FrameHeader> parse_frame_header(std::span<const uint8_t> bytes,
                                                            int bands) noexcept;
/// Parses kBandEntryBytes. Returns nothing for an unknown codec.
[[nodiscard]] std::optional<BandEntry> parse_band_entry(std::span<const uint8_t> bytes) noexcept;
/// Parses kTrailerBytes.
[[nodiscard]] std::optional<Trailer> parse_trailer(std::span<const uint8_t> bytes) noexcept;

/// Returns the four bytes at the start of a frame.
[[nodiscard]] std::span<const uint8_t> frame_magic() noexcept;

/// SequenceLayout holds the offsets of all parts of a sequence container: from its index, or from
/// the frames themselves if the index is missing (writing was interrupted) or damaged.
struct SequenceLayout {
  FileHeader header;
  SequenceInfo info;
  std::vector<uint64_t> frames;  ///< offsets of the frame headers; 0 for a damaged frame
  uint64_t data_end = 0;         ///< end of the last frame, where the next frame would be appended
  bool from_index = false;       ///< false: the frames were found by scanning the file
  bool has_every_frame = false;  ///< false: the file ends after some frame, without its index
};

/// Append what precedes the frames of a new file, whose header this sets, and what follows them.
void append_file_start(const SequenceInfo& info, FileHeader& header, std::vector<uint8_t>& to);
void append_index(const std::vector<uint64_t>& frames, uint64_t data_end, std::vector<uint8_t>& to);

/// Reads the header, the metadata and the index of an open file. Throws Error(Input) that begins
/// with `source` for a file that is not a sequence, has another version, or has a damaged header or
/// damaged metadata. Other damage loses frames, not the file. Memory is bounded by the file's size.
[[nodiscard]] SequenceLayout read_sequence_layout(int fd, const std::string& source);

/// Reads the band table of one frame. Returns false if the table is damaged or points beyond the
/// frame's end. `entries` has header.bands() elements; `scratch` is at least table_bytes() long.
[[nodiscard]] bool read_band_table(int fd, const SequenceLayout& layout, uint64_t frame,
                                   std::span<BandEntry> entries,
                                   std::span<uint8_t> scratch) noexcept;

}  // namespace lenticule::frames
