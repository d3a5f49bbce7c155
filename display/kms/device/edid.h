// SPDX-License-Identifier: Apache-2.0
// Who a panel is: the identity part of an EDID. Modes come from the kernel, not from here.
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "optics/rig.h"

namespace lenticule::display {

inline constexpr size_t kEdidBlockBytes = 128;

enum class EdidProblem {
  None,
  Absent,       ///< no bytes at all
  Short,        ///< less than one block
  BadHeader,    ///< does not begin like an EDID
  BadChecksum,  ///< damaged on the way: whose it is cannot be trusted
};

[[nodiscard]] const char* edid_problem_name(EdidProblem problem);

struct EdidIdentity {
  std::string manufacturer;  ///< three letters, or "@[\]^_" for codes that are none
  uint32_t product = 0;
  uint32_t serial_number = 0;  ///< often 0, often shared by a whole series
  std::string serial_text;     ///< printable characters only, may be empty
  std::string name;            ///< printable characters only, may be empty
  std::string sha256;          ///< of the base block, lower-case hexadecimal

  /// What a rig stores: the text of the serial number if there is one, else the number.
  [[nodiscard]] std::string serial() const;
  friend bool operator==(const EdidIdentity&, const EdidIdentity&) = default;
};

/// Columns and rows of whole pixels.
struct PixelSize {
  int width = 0;
  int height = 0;
  friend bool operator==(const PixelSize&, const PixelSize&) = default;
};

struct EdidReading {
  EdidProblem problem = EdidProblem::Absent;
  /// Only without a problem.
  std::optional<EdidIdentity> identity{};
  /// The sink says that it takes YCbCr; then a driver may choose it and alter every subpixel.
  bool offers_ycbcr = false;
  /// Television modes (VICs) that it takes as YCbCr 4:2:0 and not otherwise.
  std::vector<uint8_t> only_as_420{};
  std::optional<int> bits_per_colour{};
  /// Of the first detailed timing, if the EDID calls it the panel's own; none if it is interlaced.
  std::optional<PixelSize> base_native{};
  std::optional<PixelSize> displayid_native{};
  std::optional<PixelSize> displayid_preferred{};  ///< the first progressive one

  /// What the EDID calls the panel's own size: DisplayID's word first, then the first detailed
  /// timing's if that differs. Empty where it does not say.
  [[nodiscard]] std::vector<PixelSize> native_sizes() const;
};

/// Never throws for what the bytes say; extension blocks may be missing or damaged.
[[nodiscard]] EdidReading read_edid(std::span<const uint8_t> bytes);

/// Every member that the rig names must agree; an empty rig identity matches any panel.
[[nodiscard]] bool matches(const optics::PanelIdentity& wanted, const EdidIdentity& panel);

/// The identity that a rig for this panel carries.
[[nodiscard]] optics::PanelIdentity identity_for_rig(const EdidIdentity& panel);

/// "LGD 0x1234 serial 42 'name'"
[[nodiscard]] std::string to_string(const EdidIdentity& panel);
[[nodiscard]] std::string to_string(const optics::PanelIdentity& identity);

}  // namespace lenticule::display
