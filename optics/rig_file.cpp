// SPDX-License-Identifier: Apache-2.0
// Reads and writes rig files.
#include "optics/rig_file.h"

#include <fmt/format.h>

#include <algorithm>
#include <cctype>
#include <limits>

#include "base/error.h"
#include "base/file.h"
#include "optics/toml.h"

namespace lenticule::optics {
namespace {

constexpr size_t kMaxFileBytes = 16u << 20;

SubpixelLayout read_cells(const TomlSection& layout) {
  layout.allow_only({"columns", "rows", "offsets_px"});
  std::vector<PixelCell> cells;
  for (const toml::node& item : layout.array("offsets_px")) {
    const toml::array* list = item.as_array();
    if (list == nullptr || list->size() != 6) {
      layout.fail(item, "a cell is a list of six numbers: red x, y, green x, y, blue x, y");
    }
    const std::vector<double> v = layout.numbers(*list, "offsets_px");
    cells.push_back({{{v[0], v[1]}, {v[2], v[3]}, {v[4], v[5]}}});
  }
  return SubpixelLayout::cells(layout.whole("columns"), layout.whole("rows"), std::move(cells));
}

SubpixelLayout read_layout(const TomlSection& panel) {
  const toml::node* node = panel.find("layout");
  if (node == nullptr) return SubpixelLayout::rgb();
  try {
    return node->is_table() ? read_cells(panel.section("layout"))
                            : SubpixelLayout::named(panel.text_of(*node, "layout"));
  } catch (const Error& error) {
    // Errors of SubpixelLayout have no line number yet.
    const std::string what = error.what();
    if (what.rfind("subpixel layout", 0) == 0) panel.fail(*node, what, error.hint());
    throw;
  }
}

Mounting read_mounting(const TomlSection& panel) {
  const toml::node* node = panel.find("mounting");
  if (node == nullptr) return {};
  const std::string name = panel.text_of(*node, "mounting");
  try {
    return mounting_named(name);
  } catch (const Error& error) {
    panel.fail(*node, error.what(), error.hint());
  }
}

Panel read_panel(const TomlSection& panel) {
  panel.allow_only(
      {"width_px", "height_px", "pixel_width_mm", "pixel_height_mm", "layout", "mounting", "bits"});
  return {.width_px = panel.whole("width_px"),
          .height_px = panel.whole("height_px"),
          .pixel_width = Millimetres(panel.number("pixel_width_mm")),
          .pixel_height = Millimetres(panel.number("pixel_height_mm")),
          .layout = read_layout(panel),
          .mounting = read_mounting(panel),
          .bits = panel.find("bits") == nullptr ? kUsualBits : panel.whole("bits")};
}

ResidualMap read_residual(const TomlSection& sheet) {
  if (sheet.find("residual") == nullptr) return {};
  const TomlSection residual = sheet.section("residual");
  residual.allow_only({"columns", "rows", "lenses"});
  ResidualMap map{.columns = residual.whole("columns"),
                  .rows = residual.whole("rows"),
                  .lenses = residual.numbers(residual.array("lenses"), "lenses")};
  if (map.empty()) residual.fail(residual.get("lenses"), "'sheet.residual.lenses' is empty");
  return map;
}

std::array<Subpixels, 3> read_channel_offset(const TomlSection& sheet) {
  constexpr std::string_view kKey = "channel_offset_subpx";
  if (sheet.find(kKey) == nullptr) return {};
  const toml::array& list = sheet.array(kKey);
  if (list.size() != 3) sheet.fail(list, "'sheet.channel_offset_subpx' is not [red, green, blue]");
  const std::vector<double> v = sheet.numbers(list, kKey);
  return {Subpixels(v[0]), Subpixels(v[1]), Subpixels(v[2])};
}

LensSheet read_sheet(const TomlSection& sheet) {
  sheet.allow_only({"pitch_subpx", "slant", "offset_lenses", "gap_mm", "refraction_shape",
                    "spot_sigma_lenses", "channel_offset_subpx", "residual"});
  const LensSheet standard;
  return {.pitch = Subpixels(sheet.number("pitch_subpx")),
          .slant = sheet.number("slant"),
          .offset = Lenses(sheet.number_or("offset_lenses", 0.0)),
          .gap = Millimetres(sheet.number("gap_mm")),
          .refraction_shape = sheet.number_or("refraction_shape", standard.refraction_shape),
          .channel_offset = read_channel_offset(sheet),
          .residual = read_residual(sheet),
          .spot_sigma = Lenses(sheet.number_or("spot_sigma_lenses", standard.spot_sigma.value))};
}

ViewingLine read_viewing(const TomlSection& root) {
  const ViewingLine standard;
  if (root.find("viewing") == nullptr) return standard;
  const TomlSection viewing = root.section("viewing");
  viewing.allow_only({"distance_mm", "height_mm", "centre_mm"});
  return {.height = Millimetres(viewing.number_or("height_mm", standard.height.value)),
          .distance = Millimetres(viewing.number_or("distance_mm", standard.distance.value)),
          .centre = Millimetres(viewing.number_or("centre_mm", standard.centre.value))};
}

PanelIdentity read_identity(const TomlSection& root) {
  PanelIdentity identity;
  if (root.find("identity") == nullptr) return identity;
  const TomlSection section = root.section("identity");
  section.allow_only({"manufacturer", "product", "serial", "edid_sha256"});
  identity.manufacturer = section.text_or("manufacturer", {});
  identity.serial = section.text_or("serial", {});
  identity.edid_sha256 = section.text_or("edid_sha256", {});
  if (section.find("product") != nullptr) {
    identity.product = static_cast<uint32_t>(
        section.whole_within("product", 0, std::numeric_limits<uint32_t>::max()));
  }
  return identity;
}

/// Returns the entries in file order: toml++ sorts tables by key, but every node knows its
/// position.
std::vector<std::pair<std::string, std::string>> read_provenance(const TomlSection& root) {
  if (root.find("provenance") == nullptr) return {};
  const TomlSection section = root.section("provenance");
  struct Entry {
    toml::source_position place;
    std::string key;
    std::string text;
  };
  std::vector<Entry> entries;
  for (const auto& [key, node] : section.table()) {
    entries.push_back({key.source().begin, std::string(key.str()),
                       section.text_of(node, std::string_view(key.str()).substr(0, 64))});
  }
  std::stable_sort(entries.begin(), entries.end(),
                   [](const Entry& a, const Entry& b) { return a.place < b.place; });
  std::vector<std::pair<std::string, std::string>> out;
  for (Entry& entry : entries) out.emplace_back(std::move(entry.key), std::move(entry.text));
  return out;
}

Rig read_rig(const TomlSection& root) {
  root.allow_only({"format", "name", "panel", "sheet", "viewing", "identity", "provenance"});
  root.require_format_1();
  return {.name = root.text_or("name", {}),
          .panel = read_panel(root.section("panel")),
          .sheet = read_sheet(root.section("sheet")),
          .viewing = read_viewing(root),
          .identity = read_identity(root),
          .provenance = read_provenance(root)};
}

/// Returns the line of the key that a problem names, or of the innermost table that contains the
/// key.
unsigned line_of(const toml::table& root, std::string_view key) {
  while (!key.empty()) {
    if (const auto node = root.at_path(key)) return std::max(node.node()->source().begin.line, 1u);
    const size_t dot = key.rfind('.');
    key = dot == std::string_view::npos ? std::string_view{} : key.substr(0, dot);
  }
  return 1;
}

}  // namespace

Rig parse_rig(std::string_view text, const std::string& source) {
  const toml::table root = parse_toml(text, source);
  const Rig rig = read_rig(TomlSection(root, {}, source));
  if (const auto problem = find_problem(rig)) {
    throw Error(ErrorKind::Input,
                fmt::format("{}:{}: {}: {}", source, line_of(root, problem->key), problem->key,
                            problem->cause),
                problem->remedy);
  }
  return rig;
}

Rig load_rig(const std::filesystem::path& file) {
  return parse_rig(read_text_file(file, kMaxFileBytes), file.string());
}

namespace {

std::string key_text(const std::string& key) {
  const bool bare = !key.empty() && std::all_of(key.begin(), key.end(), [](unsigned char c) {
    return std::isalnum(c) || c == '_' || c == '-';
  });
  return bare ? key : toml_string(key);
}

void add_layout(const SubpixelLayout& layout, std::string& out) {
  if (layout.name() != "cells") {
    out += fmt::format("layout = {}\n", toml_string(layout.name()));
    return;
  }
  out += fmt::format("\n[panel.layout]\ncolumns = {}\nrows = {}\noffsets_px = [\n",
                     layout.columns(), layout.rows());
  for (const PixelCell& cell : layout.table()) {
    out +=
        fmt::format("  [{}, {}, {}, {}, {}, {}],\n", toml_number(cell[0].x_px),
                    toml_number(cell[0].y_px), toml_number(cell[1].x_px), toml_number(cell[1].y_px),
                    toml_number(cell[2].x_px), toml_number(cell[2].y_px));
  }
  out += "]\n";
}

void add_residual(const ResidualMap& map, std::string& out) {
  if (map.empty()) return;
  out += fmt::format("\n[sheet.residual]\ncolumns = {}\nrows = {}\nlenses = [\n", map.columns,
                     map.rows);
  const auto columns = static_cast<size_t>(map.columns);
  for (size_t i = 0; i < map.lenses.size(); ++i) {
    out += i % columns == 0 ? "  " : " ";
    out += toml_number(map.lenses[i]) + ',';
    if (i % columns == columns - 1) out += '\n';
  }
  out += "]\n";
}

void add_sheet(const LensSheet& sheet, std::string& out) {
  out += "\n[sheet]\n";
  out += fmt::format("pitch_subpx = {}\n", toml_number(sheet.pitch.value));
  out += fmt::format("slant = {}\n", toml_number(sheet.slant));
  out += fmt::format("offset_lenses = {}\n", toml_number(sheet.offset.value));
  out += fmt::format("gap_mm = {}\n", toml_number(sheet.gap.value));
  out += fmt::format("refraction_shape = {}\n", toml_number(sheet.refraction_shape));
  out += fmt::format("spot_sigma_lenses = {}\n", toml_number(sheet.spot_sigma.value));
  out += fmt::format(
      "channel_offset_subpx = [{}, {}, {}]\n", toml_number(sheet.channel_offset[0].value),
      toml_number(sheet.channel_offset[1].value), toml_number(sheet.channel_offset[2].value));
  add_residual(sheet.residual, out);
}

void add_identity(const PanelIdentity& identity, std::string& out) {
  if (identity.empty()) return;
  out += "\n[identity]\n";
  const auto add = [&out](const char* key, const std::string& text) {
    if (!text.empty()) out += fmt::format("{} = {}\n", key, toml_string(text));
  };
  add("manufacturer", identity.manufacturer);
  if (identity.product) out += fmt::format("product = {}\n", *identity.product);
  add("serial", identity.serial);
  add("edid_sha256", identity.edid_sha256);
}

}  // namespace

std::string rig_to_toml(const Rig& rig) {
  std::string out = "# A rig: one panel, its lens sheet, its viewing line.\nformat = 1\n";
  if (!rig.name.empty()) out += fmt::format("name = {}\n", toml_string(rig.name));
  const Panel& panel = rig.panel;
  out += fmt::format(
      "\n[panel]\nwidth_px = {}\nheight_px = {}\npixel_width_mm = {}\npixel_height_mm = {}\n",
      panel.width_px, panel.height_px, toml_number(panel.pixel_width.value),
      toml_number(panel.pixel_height.value));
  if (!panel.mounting.upright())
    out += fmt::format("mounting = {}\n", toml_string(mounting_name(panel.mounting)));
  if (panel.bits != kUsualBits) out += fmt::format("bits = {}\n", panel.bits);
  add_layout(panel.layout, out);
  add_sheet(rig.sheet, out);
  out +=
      fmt::format("\n[viewing]\ndistance_mm = {}\nheight_mm = {}\n",
                  toml_number(rig.viewing.distance.value), toml_number(rig.viewing.height.value));
  if (rig.viewing.centre.value != 0.0)
    out += fmt::format("centre_mm = {}\n", toml_number(rig.viewing.centre.value));
  add_identity(rig.identity, out);
  if (!rig.provenance.empty()) out += "\n[provenance]\n";
  for (const auto& [key, text] : rig.provenance) {
    out += fmt::format("{} = {}\n", key_text(key), toml_string(text));
  }
  return out;
}

void save_rig(const Rig& rig, const std::filesystem::path& file) {
  write_text_file(file, rig_to_toml(rig));
}

}  // namespace lenticule::optics
