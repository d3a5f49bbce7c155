// SPDX-License-Identifier: Apache-2.0
#include "display/kms/device/edid.h"

#include <fmt/format.h>
#include <openssl/evp.h>

#include <algorithm>
#include <array>
#include <numeric>
#include <utility>

#include "base/text.h"
#include "display/kms/device/edid_extensions.h"

namespace lenticule::display {
namespace {

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

bool same_hex(const std::string& a, const std::string& b) {
  return lower_case(a) == lower_case(b);
}

}  // namespace

const char* edid_problem_name(EdidProblem problem) {
  switch (problem) {
    case EdidProblem::None:
      return "ok";
    case EdidProblem::Absent:
      return "absent";
    case EdidProblem::Short:
      return "too short";
    case EdidProblem::BadHeader:
      return "not an EDID";
    case EdidProblem::BadChecksum:
      return "wrong checksum";
  }
  return "?";
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
  EdidExtensions extensions = read_extensions(bytes);
  reading.offers_ycbcr = base_offers_ycbcr(block) || extensions.offers_ycbcr;
  reading.only_as_420 = std::move(extensions.only_as_420);
  reading.bits_per_colour = bits_per_colour(block);
  reading.deep_colour = extensions.deep_colour;
  reading.base_native = base_native(block);
  reading.displayid_native = extensions.displayid_native;
  reading.displayid_preferred = extensions.displayid_preferred;
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

optics::PanelIdentity identity_for_rig(const EdidIdentity& panel) {
  return {.manufacturer = panel.manufacturer,
          .product = panel.product,
          .serial = panel.serial(),
          .edid_sha256 = panel.sha256};
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
