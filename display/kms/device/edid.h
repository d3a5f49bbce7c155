// SPDX-License-Identifier: Apache-2.0
// Reads the identity of a panel from its EDID. Modes come from the kernel instead.
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "optics/rig.h"

namespace lenticule::display {

/// Tile is the place of one connector's picture in a panel that two or more connectors feed, as 5K
/// and 8K panels with two cables have. The kernel reads it from DisplayID and states it in the
/// connector's property TILE.
struct Tile {
  uint32_t group = 0;  ///< the same for all tiles of a panel
  /// True if the tiles are one panel in one housing.
  bool single_monitor = false;
  int columns = 1, rows = 1;  ///< size of the panel in tiles
  int column = 0, row = 0;
  int width = 0, height = 0;  ///< pixels of a tile

  [[nodiscard]] int count() const { return columns * rows; }
  friend bool operator==(const Tile&, const Tile&) = default;
};

/// ConnectorFacts are the kernel's facts about a connector and its panel that need no type of
/// libdrm.
struct ConnectorFacts {
  bool connected = false;
  bool non_desktop = false;
  bool tiled = false;          ///< one of several connectors of a panel
  std::optional<Tile> tile{};  ///< set if tiled, unless the kernel's text is not valid
  bool link_bad = false;
  bool variable_refresh = false;  ///< "vrr_capable": panel and link can vary the refresh
  uint32_t width_mm = 0;
  uint32_t height_mm = 0;
};

/// Parses "group:single:columns:rows:column:row:width:height", the kernel's text, with or without a
/// zero at its end. Returns none for any other text and for impossible numbers.
[[nodiscard]] std::optional<Tile> parse_tile(std::span<const uint8_t> blob);

inline constexpr size_t kEdidBlockBytes = 128;

enum class EdidProblem {
  None,
  Absent,       ///< no bytes
  Short,        ///< less than one block
  BadHeader,    ///< not the header of an EDID
  BadChecksum,  ///< damaged: the identity cannot be trusted
};

[[nodiscard]] const char* edid_problem_name(EdidProblem problem);

struct EdidIdentity {
  std::string manufacturer;  ///< three letters, or "@[\]^_" for codes that are not letters
  uint32_t product = 0;
  uint32_t serial_number = 0;  ///< often 0, often shared by a whole series
  std::string serial_text;     ///< printable characters only, may be empty
  std::string name;            ///< printable characters only, may be empty
  std::string sha256;          ///< checksum of the base block, lower-case hexadecimal

  /// Returns the serial that a rig stores: the text if there is one, else the number.
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
  /// Set only if there is no problem.
  std::optional<EdidIdentity> identity{};
  /// The sink accepts YCbCr; a driver may then choose it and alter every subpixel.
  bool offers_ycbcr = false;
  /// Television modes (VICs) that the sink accepts as YCbCr 4:2:0 only.
  std::vector<uint8_t> only_as_420{};
  std::optional<int> bits_per_colour{};  ///< bits that the base block states
  bool deep_colour = false;              ///< the HDMI input accepts RGB of 10 bits per colour
  /// Size of the first detailed timing, if the EDID calls it native; none if it is interlaced.
  std::optional<PixelSize> base_native{};
  std::optional<PixelSize> displayid_native{};  ///< size in DisplayID's display parameters
  /// Size of the first progressive timing that DisplayID prefers.
  std::optional<PixelSize> displayid_preferred{};

  /// Returns the panel's native sizes: DisplayID's first, then the first detailed timing's if it
  /// differs. Empty if the EDID does not state any.
  [[nodiscard]] std::vector<PixelSize> native_sizes() const;
};

/// Parses an EDID. Never throws because of the contents; extension blocks may be missing or
/// damaged.
[[nodiscard]] EdidReading read_edid(std::span<const uint8_t> bytes);

/// Returns true if every member that the rig states is equal; an empty rig identity matches any
/// panel.
[[nodiscard]] bool matches(const optics::PanelIdentity& wanted, const EdidIdentity& panel);

/// Return "LGD 0x1234 serial 42 'name'".
[[nodiscard]] std::string to_string(const EdidIdentity& panel);
[[nodiscard]] std::string to_string(const optics::PanelIdentity& identity);

}  // namespace lenticule::display
