// SPDX-License-Identifier: Apache-2.0
// Validates rigs from outside and computes their fingerprint.
// Turns the numbers of a rig. The lens coordinate is a linear form a x + b y of the panel point
// relative to the centre, with a = 3 / P and b = m a: swapping the axes swaps a and b, reversing an
// axis changes one sign. If a is negative afterwards, the lenses are numbered from the other end.
#include "optics/rig.h"

#include <fmt/format.h>

#include <algorithm>
#include <bit>
#include <initializer_list>
#include <nlohmann/json.hpp>

#include "base/error_kinds.h"

namespace lenticule::optics {
namespace {

using Problem = std::optional<RigProblem>;

constexpr double kMaxPixelMm = 100.0;
constexpr double kMaxGapMm = 1000.0;
constexpr double kMaxDistanceMm = 1e6;
constexpr double kMaxOffsetLenses = 1e6;
constexpr double kMaxChannelOffsetSubpixels = 30.0;
constexpr double kMaxResidualLenses = 1000.0;
constexpr size_t kMaxTextBytes = 4096;
constexpr size_t kMaxProvenanceEntries = 256;

/// Returns a problem unless low <= value <= high; a NaN is a problem.
Problem outside(const std::string& key, double value, double low, double high) {
  if (value >= low && value <= high) return {};
  return RigProblem{key, fmt::format("{} is not within {} to {}", value, low, high), {}};
}

Problem not_positive(const std::string& key, double value, double high) {
  if (value > 0.0 && value <= high) return {};
  return RigProblem{key, fmt::format("{} is not greater than 0 and at most {}", value, high), {}};
}

/// Returns the first problem of a list.
Problem first_of(std::initializer_list<Problem> problems) {
  const auto* const found = std::ranges::find_if(problems, &Problem::has_value);
  return found == problems.end() ? Problem{} : *found;
}

Problem bits_problem(int bits) {
  if (bits == kUsualBits || bits == kDeepBits) return {};
  return RigProblem{"panel.bits", fmt::format("{} is not 8 or 10", bits),
                    "state the bits per colour that the panel shows without dithering"};
}

Problem panel_problem(const Panel& panel) {
  return first_of({outside("panel.width_px", panel.width_px, 1, kMaxPanelPixels),
                   outside("panel.height_px", panel.height_px, 1, kMaxPanelPixels),
                   not_positive("panel.pixel_width_mm", panel.pixel_width.value, kMaxPixelMm),
                   not_positive("panel.pixel_height_mm", panel.pixel_height.value, kMaxPixelMm),
                   bits_problem(panel.bits)});
}

Problem residual_problem(const ResidualMap& map, const Panel& panel, double pitch_px) {
  if (map.columns == 0 && map.rows == 0 && map.empty()) return {};
  if (Problem p = outside("sheet.residual.columns", map.columns, 1, kMaxResidualKnots)) return p;
  if (Problem p = outside("sheet.residual.rows", map.rows, 1, kMaxResidualKnots)) return p;
  const size_t columns = static_cast<size_t>(map.columns), rows = static_cast<size_t>(map.rows);
  if (map.lenses.size() != columns * rows) {
    return RigProblem{
        "sheet.residual.lenses",
        fmt::format("{} values where columns * rows = {}", map.lenses.size(), columns * rows),
        {}};
  }
  // Lenses between two knots, across and down: the divisor that turns a residual difference into a
  // relative change of pitch.
  const double step_x = panel.width_px / pitch_px / static_cast<double>(std::max(columns - 1, 1ul));
  const double step_y = panel.height_px / pitch_px / static_cast<double>(std::max(rows - 1, 1ul));
  for (size_t i = 0; i < map.lenses.size(); ++i) {
    const double here = map.lenses[i];
    if (Problem p = outside("sheet.residual.lenses", here, -kMaxResidualLenses, kMaxResidualLenses))
      return p;
    const double left = i % columns > 0 ? map.lenses[i - 1] : here;
    const double above = i >= columns ? map.lenses[i - columns] : here;
    if (std::abs(here - left) > kMaxResidualSlope * step_x ||
        std::abs(here - above) > kMaxResidualSlope * step_y) {
      return RigProblem{"sheet.residual.lenses",
                        fmt::format("value {} changes the local pitch by more than {} %", i + 1,
                                    100 * kMaxResidualSlope),
                        "a residual map describes small deviations; correct pitch_subpx and slant"};
    }
  }
  return {};
}

Problem sheet_problem(const LensSheet& sheet, const Panel& panel) {
  const double pitch = sheet.pitch.value;
  const auto channel = [&](size_t c) {
    return outside("sheet.channel_offset_subpx", sheet.channel_offset[c].value,
                   -kMaxChannelOffsetSubpixels, kMaxChannelOffsetSubpixels);
  };
  const Problem found = first_of(
      {outside("sheet.pitch_subpx", pitch, kMinPitchSubpixels, kMaxPitchSubpixels),
       outside("sheet.slant", sheet.slant, -kMaxSlant, kMaxSlant),
       outside("sheet.offset_lenses", sheet.offset.value, -kMaxOffsetLenses, kMaxOffsetLenses),
       not_positive("sheet.gap_mm", sheet.gap.value, kMaxGapMm),
       outside("sheet.refraction_shape", sheet.refraction_shape, 0.0, 1.0),
       outside("sheet.spot_sigma_lenses", sheet.spot_sigma.value, 0.0, 10.0), channel(0),
       channel(1), channel(2)});
  return found ? found : residual_problem(sheet.residual, panel, pitch / 3.0);
}

Problem viewing_problem(const ViewingLine& viewing, const LensSheet& sheet) {
  if (Problem p = first_of(
          {outside("viewing.centre_mm", viewing.centre.value, -kMaxDistanceMm, kMaxDistanceMm),
           outside("viewing.height_mm", viewing.height.value, -kMaxDistanceMm, kMaxDistanceMm)}))
    return p;
  const double z = viewing.distance.value;
  if (std::isinf(z) && z > 0) return {};
  if (Problem p = not_positive("viewing.distance_mm", z, kMaxDistanceMm)) {
    p->remedy = "write inf for parallel viewing zones";
    return p;
  }
  if (z < sheet.gap.value)
    return RigProblem{"viewing.distance_mm", "smaller than the thickness of the sheet", {}};
  return {};
}

/// Checks the geometry. Light inside the sheet cannot be steeper than the critical angle, and each
/// subpixel must find an eye for its lens: its phase must grow with the eye's x. Both conditions
/// are checked at the worst points, the panel's edges with a viewer half a lobe to the side.
Problem geometry_problem(const Rig& rig) {
  const Panel& panel = rig.panel;
  const LensSheet& sheet = rig.sheet;
  const double kappa = 1.0 - sheet.refraction_shape;
  const double inverse_z =
      std::isinf(rig.viewing.distance.value) ? 0.0 : 1.0 / rig.viewing.distance.value;
  const double edge_x =
      (0.5 * panel.width_px * panel.pixel_width.value + std::abs(rig.viewing.centre.value)) *
      inverse_z;
  const double edge_y =
      (0.5 * panel.height_px * panel.pixel_height.value + std::abs(rig.viewing.height.value)) *
      inverse_z;
  // Shifts are Delta_x / g, the tangents inside the sheet.
  const double shift_to_centre = edge_x / std::sqrt(1.0 + kappa * edge_x * edge_x);
  const double half_lens = sheet.pitch.value * panel.pixel_width.value / 6.0 / sheet.gap.value;
  const double slope = std::abs(sheet.slant) * panel.pixel_width.value / panel.pixel_height.value;
  const auto room = [&](double shift) { return 1.0 - kappa * shift * shift; };

  const double straight = shift_to_centre + half_lens;
  // Coupling is how much the y shift, which also changes with the eye's x, counteracts the x shift.
  const double coupling = slope * edge_y * kappa * straight / room(straight);
  if (room(straight) > 0.0 && !(coupling <= 0.5 && edge_x <= 1e3 && edge_y <= 1e3))
    return RigProblem{"viewing.distance_mm", "too small for a panel of this size and slant", {}};
  // The coupling and a residual map both widen a lens in terms of the shift.
  const double bend = sheet.residual.empty() ? 1.0 : 1.0 + 2.5 * kMaxResidualSlope;
  if (!(room(straight) > 0.0 &&
        room(shift_to_centre + half_lens * bend / (1.0 - coupling)) >= 0.05)) {
    return RigProblem{"sheet.gap_mm",
                      "too small for this pitch: a lens would send light beyond the critical angle",
                      "check gap_mm, pitch_subpx and the pixel size"};
  }
  return {};
}

/// Returns true for UTF-8 without control characters other than tabs and line ends.
bool is_plain_text(const std::string& text) {
  const auto is_control = [](unsigned char c) {
    return (c < 0x20 && c != '\t' && c != '\n') || c == 0x7F;
  };
  if (std::any_of(text.begin(), text.end(), is_control)) return false;
  try {
    return !nlohmann::json(text).dump().empty();  // checks the encoding
  } catch (const nlohmann::json::exception&) {
    return false;
  }
}

Problem text_problem(const std::string& key, const std::string& text) {
  if (text.size() > kMaxTextBytes) return RigProblem{key, "longer than 4096 bytes", {}};
  if (!is_plain_text(text)) return RigProblem{key, "not printable UTF-8 text", {}};
  return {};
}

Problem texts_problem(const Rig& rig) {
  const PanelIdentity& id = rig.identity;
  const Problem found = first_of({text_problem("name", rig.name),
                                  text_problem("identity.manufacturer", id.manufacturer),
                                  text_problem("identity.serial", id.serial),
                                  text_problem("identity.edid_sha256", id.edid_sha256)});
  if (found) return found;
  if (rig.provenance.size() > kMaxProvenanceEntries)
    return RigProblem{"provenance", "more than 256 entries", {}};
  for (size_t i = 0; i < rig.provenance.size(); ++i) {
    const auto& [key, text] = rig.provenance[i];
    if (Problem p = text_problem("provenance", key)) return p;
    if (Problem p = text_problem("provenance", text)) return p;
    const auto same = [&key = key](const auto& entry) { return entry.first == key; };
    const auto begin = rig.provenance.begin();
    if (std::any_of(begin, begin + static_cast<ptrdiff_t>(i), same))
      return RigProblem{"provenance", "key '" + key + "' appears twice", {}};
  }
  return {};
}

/// Hash is 64-bit FNV-1a over canonical little-endian bytes.
class Hash {
 public:
  void add(uint64_t word) {
    for (int shift = 0; shift < 64; shift += 8)
      state_ = (state_ ^ ((word >> shift) & 0xFF)) * 0x100000001B3u;
  }
  void add(int value) { add(static_cast<uint64_t>(static_cast<int64_t>(value))); }
  void add(double value) { add(std::bit_cast<uint64_t>(value == 0.0 ? 0.0 : value)); }
  [[nodiscard]] uint64_t value() const { return state_; }

 private:
  uint64_t state_ = 0xCBF29CE484222325u;
};

void add_panel(Hash& hash, const Panel& panel) {
  hash.add(panel.width_px);
  hash.add(panel.height_px);
  hash.add(panel.pixel_width.value);
  hash.add(panel.pixel_height.value);
  hash.add(panel.layout.columns());
  hash.add(panel.layout.rows());
  for (const PixelCell& cell : panel.layout.table()) {
    for (const SubpixelOffset& offset : cell) {
      hash.add(offset.x_px);
      hash.add(offset.y_px);
    }
  }
}

void add_sheet(Hash& hash, const LensSheet& sheet) {
  hash.add(sheet.pitch.value);
  hash.add(sheet.slant);
  hash.add(sheet.offset.value);
  hash.add(sheet.gap.value);
  hash.add(sheet.refraction_shape);
  for (const Subpixels offset : sheet.channel_offset) hash.add(offset.value);
  hash.add(sheet.residual.columns);
  hash.add(sheet.residual.rows);
  for (const double lenses : sheet.residual.lenses) hash.add(lenses);
  hash.add(sheet.spot_sigma.value);
}

/// Returns a stripe layout if the offsets are those of stripes except for rounding.
SubpixelLayout with_usual_name(SubpixelLayout layout) {
  constexpr double kRounding = 1e-12;
  if (layout.table().size() != 1) return layout;
  for (const char* name : {"rgb", "bgr", "vrgb", "vbgr"}) {
    SubpixelLayout stripes = SubpixelLayout::named(name);
    bool same = true;
    for (int c = 0; c < 3; ++c) {
      const SubpixelOffset &ours = layout.offset(0, 0, c), &theirs = stripes.offset(0, 0, c);
      same = same && std::abs(ours.x_px - theirs.x_px) < kRounding &&
             std::abs(ours.y_px - theirs.y_px) < kRounding;
    }
    if (same) return stripes;
  }
  return layout;
}

ResidualMap turned_residual(const ResidualMap& map, const Mounting& mounting, double sign) {
  if (map.empty()) return map;
  const PixelGrid size = mounting.turned({map.columns, map.rows});
  ResidualMap out{
      .columns = size.width, .rows = size.height, .lenses = std::vector<double>(map.lenses.size())};
  const auto index = [](PixelPlace at, int columns) {
    return static_cast<size_t>(at.row) * static_cast<size_t>(columns) +
           static_cast<size_t>(at.column);
  };
  for (int row = 0; row < map.rows; ++row)
    for (int column = 0; column < map.columns; ++column)
      out.lenses[index(mounting.seen_place({column, row}, size), out.columns)] =
          sign * map.lenses[index({column, row}, map.columns)];
  return out;
}

LensSheet turned_sheet(const LensSheet& sheet, const Mounting& mounting) {
  // Both coefficients are multiplied by P / 3, which keeps a half turn free of rounding.
  double across = 1.0, down = sheet.slant;
  if (mounting.swapped) std::swap(across, down);
  if (std::abs(down) > kMaxSlant * std::abs(across))
    throw input_error(
        "mounting: a sheet of slant {} cannot be turned by 90 degrees: its lenses would lie across "
        "the viewer's eyes",
        sheet.slant)
        .remedy("measure or write the rig as the panel is seen, and add panel.mounting to it");
  if (mounting.reversed_columns) across = -across;
  if (mounting.reversed_rows) down = -down;
  const double sign = across < 0.0 ? -1.0 : 1.0;
  LensSheet out = sheet;
  out.pitch = Subpixels(sheet.pitch.value / std::abs(across));
  out.slant = down / across;
  out.offset = Lenses(sign * sheet.offset.value);
  // A channel's offset along the sent rows moves the phase by offset / P lenses.
  for (Subpixels& offset : out.channel_offset)
    offset = Subpixels(sign * offset.value / std::abs(across));
  out.residual = turned_residual(sheet.residual, mounting, sign);
  return out;
}

}  // namespace

std::optional<RigProblem> find_problem(const Rig& rig) {
  // One after the other: the later ones compute with what the earlier ones check.
  if (Problem p = panel_problem(rig.panel)) return p;
  if (Problem p = sheet_problem(rig.sheet, rig.panel)) return p;
  if (Problem p = viewing_problem(rig.viewing, rig.sheet)) return p;
  if (Problem p = geometry_problem(rig)) return p;
  return texts_problem(rig);
}

void validate_rig(const Rig& rig, const std::string& context) {
  if (const Problem p = find_problem(rig))
    throw input_error("{}: {}: {}", context, p->key, p->cause).remedy(p->remedy);
}

std::string fingerprint(const Rig& rig) {
  Hash hash;
  add_panel(hash, rig.panel);
  add_sheet(hash, rig.sheet);
  hash.add(rig.viewing.height.value);
  hash.add(rig.viewing.distance.value);
  // Rigs whose viewer stands in front of the centre keep the fingerprint that they had before the
  // key existed.
  if (rig.viewing.centre.value != 0.0) hash.add(rig.viewing.centre.value);
  return fmt::format("{:016x}", hash.value());
}

SubpixelLayout turned_layout(const SubpixelLayout& layout, const Mounting& mounting,
                             PixelGrid sent) {
  const PixelGrid size = mounting.turned({layout.columns(), layout.rows()});
  std::vector<PixelCell> cells;
  for (int row = 0; row < size.height; ++row) {
    for (int column = 0; column < size.width; ++column) {
      const PixelPlace at = mounting.inverse().seen_place({column, row}, sent);
      // A small table repeats to the left of and above the panel's first pixel, too.
      const auto wrapped = [](int value, int period) { return (value % period + period) % period; };
      PixelCell cell{};
      for (int c = 0; c < 3; ++c) {
        SubpixelOffset offset =
            layout.offset(wrapped(at.column, layout.columns()), wrapped(at.row, layout.rows()), c);
        if (mounting.swapped) std::swap(offset.x_px, offset.y_px);
        if (mounting.reversed_columns) offset.x_px = 1.0 - offset.x_px;
        if (mounting.reversed_rows) offset.y_px = 1.0 - offset.y_px;
        cell[static_cast<size_t>(c)] = offset;
      }
      cells.push_back(cell);
    }
  }
  return with_usual_name(SubpixelLayout::cells(size.width, size.height, std::move(cells)));
}

Rig turned_rig(const Rig& rig, const Mounting& mounting) {
  const Mounting turn = combined(rig.panel.mounting.inverse(), mounting);
  const PixelGrid before{rig.panel.width_px, rig.panel.height_px};
  const PixelGrid size = turn.turned(before);
  Rig out = rig;
  out.panel.mounting = mounting;
  out.panel.width_px = size.width;
  out.panel.height_px = size.height;
  if (turn.swapped) std::swap(out.panel.pixel_width, out.panel.pixel_height);
  out.panel.layout = turned_layout(rig.panel.layout, turn, before);
  out.sheet = turned_sheet(rig.sheet, turn);
  validate_rig(out, "rig turned to mounting '" + mounting_name(mounting) + "'");
  return out;
}

}  // namespace lenticule::optics
