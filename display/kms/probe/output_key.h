// SPDX-License-Identifier: Apache-2.0
// How a person names a panel: auto, a connector, an EDID, or the card it hangs on.
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
  std::string manufacturer{};         ///< of Edid
  std::optional<uint32_t> product{};  ///< of Edid
  std::string serial{};               ///< of Edid, may be empty
  friend bool operator==(const OutputKey&, const OutputKey&) = default;
};

/// "auto" (or nothing), "HDMI-A-1", "edid:MFG[:product[:serial]]", "/dev/dri/...". The product is
/// decimal or 0x hexadecimal. Throws Error(Usage).
[[nodiscard]] OutputKey parse_output_key(std::string_view text);

/// Takes the "kms" or "kms:" off a display's name. Throws Error(Usage) if it is something else.
[[nodiscard]] OutputKey parse_kms_spec(std::string_view spec);

}  // namespace lenticule::display
