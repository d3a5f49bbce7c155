// SPDX-License-Identifier: Apache-2.0
#include "display/kms/device/edid.h"

#include <fmt/format.h>
#include <openssl/evp.h>

#include <algorithm>
#include <array>
#include <numeric>
#include <string_view>

#include "base/numbers.h"
#include "base/text.h"

namespace lenticule::display {
namespace {

/// Most tiles along a side, and most pixels: DisplayID has no larger numbers.
constexpr uint32_t kMostTiles = 64;
constexpr uint32_t kMostPixels = 65536;

// The extension blocks (CTA-861, DisplayID) determine a link's encoding and state native sizes.

using Bytes = std::span<const uint8_t>;

constexpr uint8_t kCtaBlock = 0x02;
constexpr uint8_t kDisplayIdBlock = 0x70;

int little_endian_16(Bytes at) { return at[0] | at[1] << 8; }

// --- CTA-861 --------------------------------------------------------------------------------

/// Returns the VIC. 1 to 127 and 193 to 253 are VICs; 129 to 192 are VICs with a bit for "native".
uint8_t vic_of(uint8_t descriptor) {
  return descriptor >= 129 && descriptor <= 192 ? descriptor & 0x7f : descriptor;
}

/// Returns true for HDMI's own data block with its flag for 30 bits per pixel.
bool accepts_30_bits(Bytes block) {
  constexpr uint8_t kHdmi[] = {0x03, 0x0c, 0x00};  // its identifier, lowest byte first
  constexpr size_t kFlags = 6;
  constexpr uint8_t kThirtyBits = 0x10;
  return block.size() > kFlags && std::ranges::equal(block.subspan(1, 3), kHdmi) &&
         (block[kFlags] & kThirtyBits) != 0;
}

void read_cta_data_block(Bytes block, EdidReading& found) {
  constexpr uint8_t kVendor = 3;
  constexpr uint8_t kExtended = 7;
  constexpr uint8_t kVideo420 = 14;
  constexpr uint8_t kCapability420 = 15;
  if (block[0] >> 5 == kVendor && accepts_30_bits(block)) found.deep_colour = true;
  if (block[0] >> 5 != kExtended || block.size() < 2) return;
  if (block[1] != kVideo420 && block[1] != kCapability420) return;
  found.offers_ycbcr = true;
  if (block[1] == kCapability420) return;
  for (const uint8_t descriptor : block.subspan(2))
    if (vic_of(descriptor) != 0 && vic_of(descriptor) != 128)
      found.only_as_420.push_back(vic_of(descriptor));
}

void read_cta_data_blocks(Bytes blocks, EdidReading& found) {
  while (!blocks.empty()) {
    const size_t size = 1 + (blocks[0] & 0x1fU);
    if (size > blocks.size()) return;
    read_cta_data_block(blocks.first(size), found);
    blocks = blocks.subspan(size);
  }
}

/// Parses a CTA block. Data blocks precede the offset of the timings; revision 1 has no flags,
/// revision 2 no data blocks.
void read_cta(Bytes block, EdidReading& found) {
  constexpr uint8_t kYcbcr444And422 = 0x30;
  constexpr size_t kHeader = 4;
  const uint8_t revision = block[1];
  const size_t offset = block[2];
  if (offset < kHeader) return;
  if (revision >= 2 && (block[3] & kYcbcr444And422) != 0) found.offers_ycbcr = true;
  if (revision >= 3 && offset < block.size())
    read_cta_data_blocks(block.subspan(kHeader, offset - kHeader), found);
}

// --- DisplayID ------------------------------------------------------------------------------

/// The relevant fields of a timing.
struct ListedTiming {
  bool preferred = false;
  bool interlaced = false;
  PixelSize size;
};

ListedTiming type_1_or_7(Bytes x, bool may_be_preferred) {
  return {.preferred = may_be_preferred && (x[3] & 0x80) != 0,
          .interlaced = (x[3] & 0x10) != 0,
          .size = {1 + little_endian_16(x.subspan(4)), 1 + little_endian_16(x.subspan(12))}};
}

ListedTiming type_2(Bytes x) {
  return {.preferred = (x[3] & 0x80) != 0,
          .interlaced = (x[3] & 0x10) != 0,
          .size = {8 + 8 * (x[4] | (x[5] & 1) << 8), 1 + (x[7] | (x[8] & 15) << 8)}};
}

ListedTiming type_3(Bytes x) {
  struct Aspect {
    int width, height;
  };
  constexpr Aspect kAspects[] = {{1, 1},  {5, 4},   {4, 3},   {15, 9},
                                 {16, 9}, {16, 10}, {64, 27}, {256, 135}};
  const size_t aspect = x[0] & 15U;
  if (aspect >= std::size(kAspects)) return {};
  const int width = 8 + 8 * x[1];
  return {.preferred = (x[0] & 0x80) != 0,
          .interlaced = (x[2] & 0x80) != 0,
          .size = {width, width * kAspects[aspect].height / kAspects[aspect].width}};
}

ListedTiming type_5(Bytes x) {
  return {.preferred = (x[0] & 0x80) != 0,
          .interlaced = false,
          .size = {1 + little_endian_16(x.subspan(2)), 1 + little_endian_16(x.subspan(4))}};
}

ListedTiming type_6(Bytes x) {
  return {.preferred = (x[2] & 0x80) != 0,
          .interlaced = (x[13] & 0x80) != 0,
          .size = {1 + (x[3] | (x[4] & 0x3f) << 8), 1 + (x[5] | (x[6] & 0x3f) << 8)}};
}

void note_timing(const ListedTiming& timing, EdidReading& found) {
  if (timing.preferred && !timing.interlaced && !found.displayid_preferred)
    found.displayid_preferred = timing.size;
}

template <typename Read>
void read_timings(Bytes payload, size_t size, const Read& read, EdidReading& found) {
  for (; payload.size() >= size; payload = payload.subspan(size))
    note_timing(read(payload.first(size)), found);
}

void read_type_6_timings(Bytes payload, EdidReading& found) {
  while (payload.size() >= 14) {
    // Size with or without the image's size.
    const size_t size = (payload[2] & 0x40) != 0 ? 17 : 14;
    note_timing(type_6(payload), found);
    payload = payload.subspan(std::min(size, payload.size()));
  }
}

void note_native(Bytes pixels, EdidReading& found) {
  const PixelSize size{little_endian_16(pixels), little_endian_16(pixels.subspan(2))};
  if (size.width > 0 && size.height > 0 && !found.displayid_native) found.displayid_native = size;
}

bool any_bit(Bytes bytes) {
  return std::any_of(bytes.begin(), bytes.end(), [](uint8_t byte) { return byte != 0; });
}

void read_displayid_data_block(uint8_t tag, uint8_t revision, Bytes payload, EdidReading& found) {
  const unsigned level = revision & 7U;
  switch (tag) {
    case 0x01:  // display parameters
      if (payload.size() == 12) note_native(payload.subspan(4), found);
      return;
    case 0x21:
      if (payload.size() == 29) note_native(payload.subspan(4), found);
      return;
    case 0x03:  // detailed timings; from level 2 the "preferred" bit means YCbCr 4:2:0
    case 0x22: {
      const size_t longer = tag == 0x22 ? revision >> 4 & 7U : 0U;
      return read_timings(
          payload, 20 + longer,
          [&](Bytes x) {
            if (level >= 2 && (x[3] & 0x80) != 0) found.offers_ycbcr = true;
            return type_1_or_7(x, level < 2);
          },
          found);
    }
    case 0x04:
      return read_timings(payload, 11, type_2, found);
    case 0x05:
      return read_timings(payload, 3, type_3, found);
    case 0x11:
      return read_timings(payload, 7, type_5, found);
    case 0x13:
      return read_type_6_timings(payload, found);
    case 0x0f:  // display interface: depths of RGB, 4:4:4, 4:2:2
      if (payload.size() == 10 && any_bit(payload.subspan(3, 2))) found.offers_ycbcr = true;
      return;
    case 0x26:  // display interface features: depths of RGB, 4:4:4, 4:2:2, 4:2:0
      if (payload.size() >= 9 && any_bit(payload.subspan(1, 3))) found.offers_ycbcr = true;
      return;
    case 0x81:
      return read_cta_data_blocks(payload, found);
    default:
      return;
  }
}

void read_displayid(Bytes block, EdidReading& found) {
  constexpr size_t kHeader = 5;
  constexpr size_t kMostBytes = 121;
  Bytes rest = block.subspan(kHeader, std::min<size_t>(block[2], kMostBytes));
  while (rest.size() >= 3) {
    const size_t size = 3U + rest[2];
    const bool at_the_end = rest[0] == 0 && rest[2] == 0;
    if (size > rest.size() || at_the_end) return;
    read_displayid_data_block(rest[0], rest[1], rest.subspan(3, size - 3), found);
    rest = rest.subspan(size);
  }
}

/// Parses every complete block after the first. Never throws because of the contents; incomplete
/// blocks and data blocks are skipped.
void read_extensions(Bytes edid, EdidReading& found) {
  for (size_t at = kEdidBlockBytes; at + kEdidBlockBytes <= edid.size(); at += kEdidBlockBytes) {
    const Bytes block = edid.subspan(at, kEdidBlockBytes);
    if (block[0] == kCtaBlock) read_cta(block, found);
    if (block[0] == kDisplayIdBlock) read_displayid(block, found);
  }
}

constexpr std::array<uint8_t, 8> kHeader = {0, 0xff, 0xff, 0xff, 0xff, 0xff, 0xff, 0};
constexpr std::array<size_t, 4> kDescriptors = {54, 72, 90, 108};
constexpr size_t kDescriptorText = 13;
constexpr uint8_t kTagSerial = 0xff;
constexpr uint8_t kTagName = 0xfc;
constexpr size_t kFeatures = 24;

using Block = std::span<const uint8_t, kEdidBlockBytes>;

bool sums_to_zero(std::span<const uint8_t> block) {
  return static_cast<uint8_t>(std::accumulate(block.begin(), block.end(), 0U)) == 0;
}

/// Decodes three letters of five bits each. 0 and 27 to 31 are not letters; they become the
/// neighbouring ASCII characters ("@[\]^_"), as the kernel and edid-decode write them.
std::string manufacturer_of(Block block) {
  const unsigned packed = static_cast<unsigned>(block[8]) << 8 | block[9];
  std::string letters;
  for (const int shift : {10, 5, 0})
    letters += static_cast<char>('@' + static_cast<char>(packed >> shift & 31U));
  return letters;
}

uint32_t little_endian(std::span<const uint8_t> bytes) {
  uint32_t value = 0;
  for (size_t i = bytes.size(); i > 0; --i) value = value << 8 | bytes[i - 1];
  return value;
}

/// Decodes text that ends at a line feed; skips characters that are not printable.
std::string descriptor_text(std::span<const uint8_t> bytes) {
  std::string text;
  for (const uint8_t byte : bytes) {
    if (byte == '\n' || byte == 0) break;
    if (byte >= ' ' && byte <= '~') text += static_cast<char>(byte);
  }
  while (!text.empty() && text.back() == ' ') text.pop_back();
  return text;
}

std::string text_with_tag(Block block, uint8_t tag) {
  for (const size_t at : kDescriptors) {
    const auto descriptor = block.subspan(at, 18);
    const bool is_text = descriptor[0] == 0 && descriptor[1] == 0 && descriptor[2] == 0;
    if (is_text && descriptor[3] == tag)
      return descriptor_text(descriptor.subspan(5, kDescriptorText));
  }
  return {};
}

std::string sha256_hex(std::span<const uint8_t> bytes) {
  std::array<unsigned char, EVP_MAX_MD_SIZE> digest{};
  unsigned length = 0;
  if (EVP_Digest(bytes.data(), bytes.size(), digest.data(), &length, EVP_sha256(), nullptr) != 1)
    return {};
  std::string hex;
  for (unsigned i = 0; i < length; ++i) hex += fmt::format("{:02x}", digest[i]);
  return hex;
}

bool is_digital_1_4(Block block) {
  return (block[20] & 0x80) != 0 && block[18] == 1 && block[19] >= 4;
}

/// Returns true if the base block offers YCbCr. Older revisions use the same bits for the type of
/// an analogue display.
bool base_offers_ycbcr(Block block) {
  constexpr uint8_t kColourFormats = 0x18;
  return is_digital_1_4(block) && (block[kFeatures] & kColourFormats) != 0;
}

std::optional<int> bits_per_colour(Block block) {
  const int code = block[20] >> 4 & 7;
  if (!is_digital_1_4(block) || code < 1 || code > 6) return std::nullopt;
  return 4 + 2 * code;
}

/// Returns the size of the first detailed timing if the feature byte calls it native. A descriptor
/// that begins with a pixel clock of zero is text, not a timing.
std::optional<PixelSize> base_native(Block block) {
  constexpr uint8_t kFirstIsNative = 0x02;
  const auto has_clock = [&](size_t at) { return block[at] != 0 || block[at + 1] != 0; };
  const auto first = std::find_if(kDescriptors.begin(), kDescriptors.end(), has_clock);
  if ((block[kFeatures] & kFirstIsNative) == 0 || first == kDescriptors.end()) return std::nullopt;
  const auto timing = block.subspan(*first, 18);
  const bool interlaced = (timing[17] & 0x80) != 0;
  const PixelSize size{.width = timing[2] | (timing[4] & 0xf0) << 4,
                       .height = timing[5] | (timing[7] & 0xf0) << 4};
  if (interlaced || size.width == 0 || size.height == 0) return std::nullopt;
  return size;
}

EdidProblem problem_of(std::span<const uint8_t> bytes) {
  if (bytes.empty()) return EdidProblem::Absent;
  if (bytes.size() < kEdidBlockBytes) return EdidProblem::Short;
  if (!std::equal(kHeader.begin(), kHeader.end(), bytes.begin())) return EdidProblem::BadHeader;
  if (!sums_to_zero(bytes.first(kEdidBlockBytes))) return EdidProblem::BadChecksum;
  return EdidProblem::None;
}

/// Compares manufacturers. In rigs of earlier versions '?' stands for a character that is not a
/// letter.
bool same_maker(const std::string& wanted, const std::string& panel) {
  return std::equal(wanted.begin(), wanted.end(), panel.begin(), panel.end(),
                    [](char x, char y) { return x == y || (x == '?' && (y < 'A' || y > 'Z')); });
}

bool same_hex(const std::string& a, const std::string& b) { return lower_case(a) == lower_case(b); }

}  // namespace

std::optional<Tile> parse_tile(std::span<const uint8_t> blob) {
  std::string_view text(reinterpret_cast<const char*>(blob.data()), blob.size());
  if (text.ends_with('\0')) text.remove_suffix(1);
  const auto numbers = numbers_from<uint32_t, 8>(text, ':');
  if (!numbers) return std::nullopt;
  const auto [group, single, columns, rows, column, row, width, height] = *numbers;
  const bool possible = columns >= 1 && columns <= kMostTiles && rows >= 1 && rows <= kMostTiles &&
                        column < columns && row < rows && width >= 1 && width <= kMostPixels &&
                        height >= 1 && height <= kMostPixels;
  if (!possible) return std::nullopt;
  return Tile{.group = group,
              .single_monitor = single != 0,
              .columns = static_cast<int>(columns),
              .rows = static_cast<int>(rows),
              .column = static_cast<int>(column),
              .row = static_cast<int>(row),
              .width = static_cast<int>(width),
              .height = static_cast<int>(height)};
}

const char* edid_problem_name(EdidProblem problem) {
  constexpr const char* kNames[] = {"ok", "absent", "too short", "not an EDID", "wrong checksum"};
  return kNames[static_cast<size_t>(problem)];
}

std::vector<PixelSize> EdidReading::native_sizes() const {
  std::vector<PixelSize> sizes;
  const auto& displayid = displayid_native ? displayid_native : displayid_preferred;
  for (const auto& size : {displayid, base_native})
    if (size && std::find(sizes.begin(), sizes.end(), *size) == sizes.end()) sizes.push_back(*size);
  return sizes;
}

std::string EdidIdentity::serial() const {
  if (!serial_text.empty()) return serial_text;
  return serial_number == 0 ? std::string() : std::to_string(serial_number);
}

EdidReading read_edid(std::span<const uint8_t> bytes) {
  EdidReading reading{.problem = problem_of(bytes)};
  if (reading.problem != EdidProblem::None) return reading;
  const Block block = bytes.first<kEdidBlockBytes>();
  reading.identity = EdidIdentity{.manufacturer = manufacturer_of(block),
                                  .product = little_endian(block.subspan(10, 2)),
                                  .serial_number = little_endian(block.subspan(12, 4)),
                                  .serial_text = text_with_tag(block, kTagSerial),
                                  .name = text_with_tag(block, kTagName),
                                  .sha256 = sha256_hex(block)};
  reading.offers_ycbcr = base_offers_ycbcr(block);
  reading.bits_per_colour = bits_per_colour(block);
  reading.base_native = base_native(block);
  read_extensions(bytes, reading);
  return reading;
}

bool matches(const optics::PanelIdentity& wanted, const EdidIdentity& panel) {
  if (!wanted.manufacturer.empty() && !same_maker(wanted.manufacturer, panel.manufacturer))
    return false;
  if (wanted.product && *wanted.product != panel.product) return false;
  if (!wanted.serial.empty() && wanted.serial != panel.serial_text &&
      wanted.serial != std::to_string(panel.serial_number))
    return false;
  return wanted.edid_sha256.empty() || same_hex(wanted.edid_sha256, panel.sha256);
}

std::string to_string(const EdidIdentity& panel) {
  std::string text = fmt::format("{} 0x{:04x}", panel.manufacturer, panel.product);
  if (const std::string serial = panel.serial(); !serial.empty())
    text += fmt::format(" serial {}", serial);
  if (!panel.name.empty()) text += fmt::format(" '{}'", panel.name);
  return text;
}

std::string to_string(const optics::PanelIdentity& identity) {
  std::string text = identity.manufacturer.empty() ? "any manufacturer" : identity.manufacturer;
  if (identity.product) text += fmt::format(" 0x{:04x}", *identity.product);
  if (!identity.serial.empty()) text += fmt::format(" serial {}", identity.serial);
  if (!identity.edid_sha256.empty())
    text += fmt::format(" EDID {}", identity.edid_sha256.substr(0, 12));
  return text;
}

}  // namespace lenticule::display
