// SPDX-License-Identifier: Apache-2.0
// OutputRequest is what the user asks for: an output, the panel on it and its mode.
#pragma once

#include <cstddef>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

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

/// Returns `request` for the output that `text` names: "auto" (or nothing), "HDMI-A-1",
/// "edid:MFG[:product[:serial]]", "/dev/dri/...". The product is decimal or 0x hexadecimal. Throws
/// Error(Usage).
[[nodiscard]] OutputRequest parse_output(std::string_view text, OutputRequest request = {});

/// Does the same for the rest of a display's name after "kms" or "kms:". Throws Error(Usage) if the
/// name does not begin so.
[[nodiscard]] OutputRequest parse_kms_spec(std::string_view spec, OutputRequest request = {});

}  // namespace lenticule::display
