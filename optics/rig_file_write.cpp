// SPDX-License-Identifier: Apache-2.0
// Writes rig files. Numbers have the fewest digits that read back as the same bits.
#include <fmt/format.h>

#include <algorithm>
#include <cctype>

#include "base/file.h"
#include "optics/rig_file.h"
#include "optics/toml_write.h"

namespace lenticule::optics {
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
