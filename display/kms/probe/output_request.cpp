// SPDX-License-Identifier: Apache-2.0
#include "display/kms/probe/output_request.h"

#include <fmt/format.h>

#include <algorithm>
#include <utility>

#include "base/error.h"
#include "base/numbers.h"

namespace lenticule::display {
namespace {

constexpr std::string_view kEdidPrefix = "edid:";
constexpr size_t kLongestName = 64;

[[noreturn]] void reject(std::string_view text, const char* cause) {
  throw Error(ErrorKind::Usage, fmt::format("output '{}': {}", text, cause),
              "write auto, HDMI-A-1, edid:MFG[:product[:serial]] or /dev/dri/by-path/...; "
              "'lenticule panels' lists the connected panels");
}

std::optional<uint32_t> parse_product(std::string_view text) {
  const bool hexadecimal = text.starts_with("0x") || text.starts_with("0X");
  if (hexadecimal) text.remove_prefix(2);
  return number_from<uint16_t>(text, hexadecimal ? 16 : 10);
}

optics::PanelIdentity parse_edid(std::string_view text) {
  optics::PanelIdentity edid;
  std::string_view rest = text.substr(kEdidPrefix.size());
  edid.manufacturer = take_until(rest, ':');
  const bool letters = edid.manufacturer.size() == 3 &&
                       std::all_of(edid.manufacturer.begin(), edid.manufacturer.end(),
                                   [](char letter) { return letter >= 'A' && letter <= 'Z'; });
  if (!letters) reject(text, "a manufacturer is three capital letters");
  if (rest.empty()) return edid;
  edid.product = parse_product(take_until(rest, ':'));
  if (!edid.product) reject(text, "the product is a number up to 65535");
  edid.serial = rest;
  return edid;
}

bool is_connector_name(std::string_view text) {
  return text.size() <= kLongestName && text.find('-') != std::string_view::npos &&
         std::all_of(text.begin(), text.end(), [](char c) {
           return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9') ||
                  c == '-';
         });
}

}  // namespace

OutputRequest parse_output(std::string_view text, OutputRequest request) {
  request.connector.clear();
  request.card.clear();
  request.edid = {};
  if (text.empty() || text == "auto") return request;
  if (text.starts_with(kEdidPrefix))
    request.edid = parse_edid(text);
  else if (text.starts_with('/'))
    request.card = text;
  else if (is_connector_name(text))
    request.connector = text;
  else
    reject(text, "not understood");
  return request;
}

OutputRequest parse_kms_spec(std::string_view spec, OutputRequest request) {
  constexpr std::string_view kName = "kms";
  if (!spec.starts_with(kName)) reject(spec, "not a KMS display");
  const std::string_view rest = spec.substr(kName.size());
  if (!rest.empty() && !rest.starts_with(':')) reject(spec, "not understood");
  return parse_output(rest.empty() ? rest : rest.substr(1), std::move(request));
}

}  // namespace lenticule::display
