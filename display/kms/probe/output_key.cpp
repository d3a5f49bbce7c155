// SPDX-License-Identifier: Apache-2.0
#include "display/kms/probe/output_key.h"

#include <fmt/format.h>

#include <algorithm>

#include "base/error.h"
#include "base/numbers.h"

namespace lenticule::display {
namespace {

constexpr std::string_view kEdidPrefix = "edid:";
constexpr size_t kLongestName = 64;

[[noreturn]] void reject(std::string_view text, const char* cause) {
  throw Error(ErrorKind::Usage, fmt::format("output '{}': {}", text, cause),
              "write auto, HDMI-A-1, edid:MFG[:product[:serial]] or /dev/dri/by-path/...; "
              "'lenticule panels' lists what there is");
}

std::optional<uint32_t> parse_product(std::string_view text) {
  const bool hexadecimal = text.starts_with("0x") || text.starts_with("0X");
  if (hexadecimal) text.remove_prefix(2);
  return number_from<uint16_t>(text, hexadecimal ? 16 : 10);
}

OutputKey parse_edid_key(std::string_view text) {
  OutputKey key{.kind = OutputKey::Kind::Edid};
  std::string_view rest = text.substr(kEdidPrefix.size());
  key.manufacturer = take_until(rest, ':');
  const bool letters = key.manufacturer.size() == 3 &&
                       std::all_of(key.manufacturer.begin(), key.manufacturer.end(),
                                   [](char letter) { return letter >= 'A' && letter <= 'Z'; });
  if (!letters) reject(text, "a maker has three capital letters");
  if (rest.empty()) return key;
  key.product = parse_product(take_until(rest, ':'));
  if (!key.product) reject(text, "the product is a number up to 65535");
  key.serial = rest;
  return key;
}

bool is_connector_name(std::string_view text) {
  return text.size() <= kLongestName && text.find('-') != std::string_view::npos &&
         std::all_of(text.begin(), text.end(), [](char c) {
           return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9') ||
                  c == '-';
         });
}

}  // namespace

OutputKey parse_output_key(std::string_view text) {
  if (text.empty() || text == "auto") return {};
  if (text.starts_with(kEdidPrefix)) return parse_edid_key(text);
  if (text.starts_with('/')) return {.kind = OutputKey::Kind::Card, .text = std::string(text)};
  if (!is_connector_name(text)) reject(text, "not understood");
  return {.kind = OutputKey::Kind::Connector, .text = std::string(text)};
}

OutputKey parse_kms_spec(std::string_view spec) {
  constexpr std::string_view kName = "kms";
  if (!spec.starts_with(kName)) reject(spec, "not a KMS display");
  std::string_view rest = spec.substr(kName.size());
  if (rest.empty()) return {};
  if (!rest.starts_with(':')) reject(spec, "not understood");
  return parse_output_key(rest.substr(1));
}

}  // namespace lenticule::display
