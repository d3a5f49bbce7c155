// SPDX-License-Identifier: Apache-2.0
// OutputRequest is what the user asks for: an output, the panel on it and its mode.
#pragma once

#include <algorithm>
#include <cstddef>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "base/error_kinds.h"
#include "base/numbers.h"
#include "display/scanout_format.h"
#include "frames/frame.h"
#include "frames/rational.h"
#include "optics/rig.h"

namespace lenticule::display {

enum class IdentityPolicy {
  Require,  ///< the panel must be the one for which the rig was made
  Ignore,   ///< any connected panel, for test cards and measurements
};

/// OutputPart is one panel of a wall whose panels are on one card.
struct OutputPart {
  std::string name{};                ///< name in the wall
  std::string connector{};           ///< empty = the one whose panel has the identity
  optics::PanelIdentity identity{};  ///< empty = any panel on the connector
  ScanoutPart place{};
  friend bool operator==(const OutputPart&, const OutputPart&) = default;
};

struct OutputRequest {
  // The name of the output, at most one of the three; none = any output ("auto").
  std::string connector{};       ///< "HDMI-A-1"
  std::string card{};            ///< path of the card's node
  optics::PanelIdentity edid{};  ///< manufacturer, and perhaps product and serial number

  optics::PanelIdentity identity{};  ///< panel identity in the rig; empty = any
  IdentityPolicy policy = IdentityPolicy::Require;

  // The mode.
  frames::FrameGeometry panel{};             ///< size of the picture that is sent
  std::optional<frames::Rate> refresh{};     ///< none = the panel's preferred mode
  ScanoutDepth depth = ScanoutDepth::Bits8;  ///< bits per colour of panel and link
  /// The panels of a wall, all on one card; then `panel` is the size of all parts together, and
  /// `connector`, `edid` and `identity` are empty.
  std::vector<OutputPart> parts{};

  /// Returns the size of the picture that the n-th connector of the output sends, or of the whole
  /// panel if the connector belongs to a tiled one.
  [[nodiscard]] const frames::FrameGeometry& panel_of(size_t n) const {
    return parts.empty() ? panel : parts[n].place.geometry;
  }
  /// Returns the panel that the n-th connector must have.
  [[nodiscard]] const optics::PanelIdentity& identity_of(size_t n) const {
    return parts.empty() ? identity : parts[n].identity;
  }

  friend bool operator==(const OutputRequest&, const OutputRequest&) = default;
};

inline constexpr std::string_view kEdidPrefix = "edid:";
inline constexpr size_t kLongestName = 64;

[[noreturn]] inline void reject(std::string_view text, const char* cause) {
  throw usage_error("output '{}': {}", text, cause)
      .remedy(
          "write auto, HDMI-A-1, edid:MFG[:product[:serial]] or /dev/dri/by-path/...; "
          "'lenticule panels' lists the connected panels");
}

inline std::optional<uint32_t> parse_product(std::string_view text) {
  const bool hexadecimal = text.starts_with("0x") || text.starts_with("0X");
  if (hexadecimal) text.remove_prefix(2);
  return number_from<uint16_t>(text, hexadecimal ? 16 : 10);
}

inline optics::PanelIdentity parse_edid(std::string_view text) {
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

inline bool is_connector_name(std::string_view text) {
  return text.size() <= kLongestName && text.find('-') != std::string_view::npos &&
         std::all_of(text.begin(), text.end(), [](char c) {
           return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9') ||
                  c == '-';
         });
}

/// Returns `request` for the output that `text` names: "auto" (or nothing), "HDMI-A-1",
/// "edid:MFG[:product[:serial]]", "/dev/dri/...". The product is decimal or 0x hexadecimal. Throws
/// Error(Usage).
[[nodiscard]] inline OutputRequest parse_output(std::string_view text, OutputRequest request = {}) {
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

/// Does the same for the rest of a display's name after "kms" or "kms:". Throws Error(Usage) if the
/// name does not begin so.
[[nodiscard]] inline OutputRequest parse_kms_spec(std::string_view spec,
                                                  OutputRequest request = {}) {
  constexpr std::string_view kName = "kms";
  if (!spec.starts_with(kName)) reject(spec, "not a KMS display");
  const std::string_view rest = spec.substr(kName.size());
  if (!rest.empty() && !rest.starts_with(':')) reject(spec, "not understood");
  return parse_output(rest.empty() ? rest : rest.substr(1), std::move(request));
}

}  // namespace lenticule::display
