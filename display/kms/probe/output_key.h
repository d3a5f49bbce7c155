// SPDX-License-Identifier: Apache-2.0
// OutputKey is the user's name of a panel: auto, a connector, an EDID, or the card to which it is
// connected.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>

namespace lenticule::display {

struct OutputKey {
  enum class Kind { Auto, Connector, Edid, Card };
  Kind kind = Kind::Auto;
  std::string text{};                 ///< connector name or path of a card
  std::string manufacturer{};         ///< set for Edid
  std::optional<uint32_t> product{};  ///< set for Edid
  std::string serial{};               ///< set for Edid, may be empty
  friend bool operator==(const OutputKey&, const OutputKey&) = default;
};

/// Parses "auto" (or nothing), "HDMI-A-1", "edid:MFG[:product[:serial]]", "/dev/dri/...". The
/// product is decimal or 0x hexadecimal. Throws Error(Usage).
[[nodiscard]] OutputKey parse_output_key(std::string_view text);

/// Parses the rest of a display's name after "kms" or "kms:". Throws Error(Usage) if the name does
/// not begin so.
[[nodiscard]] OutputKey parse_kms_spec(std::string_view spec);

}  // namespace lenticule::display
