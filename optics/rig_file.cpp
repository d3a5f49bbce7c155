// SPDX-License-Identifier: Apache-2.0
// Reads and writes rig files.
#include "optics/rig_file.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <unistd.h>

#include <algorithm>
#include <atomic>
#include <cctype>
#include <cerrno>
#include <cstdint>
#include <limits>
#include <optional>
#include <system_error>
#include <utility>

#include "base/error_kinds.h"
#include "base/numbers.h"
#include "optics/toml.h"
#include "optics/trim.h"

namespace lenticule::optics {
namespace {

constexpr size_t kMaxFileBytes = 16u << 20;

SubpixelLayout read_cells(const TomlSection& layout) {
  layout.allow_only({"columns", "rows", "offsets_px"});
  std::vector<PixelCell> cells;
  for (const toml::node& item : layout.array("offsets_px")) {
    const toml::array* list = item.as_array();
    if (list == nullptr || list->size() != 6)
      layout.fail(item, "a cell is a list of six numbers: red x, y, green x, y, blue x, y");
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

namespace fs = std::filesystem;

/// CopyName holds "rig" and ".toml" of "rig.toml".
struct CopyName {
  fs::path folder;
  std::string stem;
  std::string extension;

  explicit CopyName(const fs::path& file)
      : folder(file.has_parent_path() ? file.parent_path() : fs::path(".")),
        stem(file.stem().string()),
        extension(file.extension().string()) {}

  [[nodiscard]] fs::path numbered(uint64_t number) const {
    return folder / fmt::format("{}.{}{}", stem, number, extension);
  }
  /// Returns the number in `name`, 0 if it is not a numbered copy.
  [[nodiscard]] uint64_t number_of(const std::string& name) const {
    const size_t around = stem.size() + 1 + extension.size();
    if (name.size() <= around || name.size() > around + 9) return 0;
    if (!name.starts_with(stem + ".") || !name.ends_with(extension)) return 0;
    return number_from<uint64_t>(
               std::string_view(name).substr(stem.size() + 1, name.size() - around))
        .value_or(0);
  }
};

uint64_t highest_number(const CopyName& name) {
  uint64_t highest = 0;  // if the folder cannot be listed, the next step finds free numbers
  for (const fs::path& entry : entries_of(name.folder))
    highest = std::max(highest, name.number_of(entry.filename().string()));
  return highest;
}

/// Renames only if the new name does not exist. Returns 0 or errno.
int rename_to_new(const fs::path& from, const fs::path& to) {
  if (::renameat2(AT_FDCWD, from.c_str(), AT_FDCWD, to.c_str(), RENAME_NOREPLACE) == 0) return 0;
  if (errno == EEXIST) return EEXIST;
  // File systems without this flag, mostly network ones, support links.
  if (::link(from.c_str(), to.c_str()) != 0) return errno;
  ::unlink(from.c_str());
  return 0;
}

class RemovedAtEnd {
 public:
  explicit RemovedAtEnd(fs::path path) : path_(std::move(path)) {}
  ~RemovedAtEnd() {
    if (!path_.empty()) ::unlink(path_.c_str());
  }
  RemovedAtEnd(const RemovedAtEnd&) = delete;
  RemovedAtEnd& operator=(const RemovedAtEnd&) = delete;
  void keep() { path_.clear(); }

 private:
  fs::path path_;
};

fs::path copy_beside(const fs::path& file) {
  const std::string text = read_text_file(file, kMaxFileBytes);
  const CopyName name(file);
  // The copy is written under a temporary name first, so that a numbered copy is always complete.
  static std::atomic<uint64_t> counter{0};
  const auto working =
      name.folder / fmt::format(".{}.copy-{}-{}", name.stem, ::getpid(), counter++);
  RemovedAtEnd removed(working);
  write_text_file(working, text);
  constexpr int kTries = 1000;  // other programs may take numbers too, but not forever
  uint64_t number = highest_number(name);
  for (int i = 0; i < kTries; ++i) {
    const fs::path copy = name.numbered(++number);
    const int error = rename_to_new(working, copy);
    if (error == 0) return copy;
    if (error != EEXIST)
      throw failed_error("{}: cannot copy the old rig: {}", copy.string(),
                         std::generic_category().message(error));
  }
  throw failed_error("{}: no free number for a copy of the old rig", file.string())
      .remedy("move its old copies to another folder");
}

std::string text_or_nothing(const fs::path& file) {
  std::error_code error;
  return fs::exists(file, error) ? read_text_file(file, kMaxFileBytes) : std::string();
}

/// Returns the texts of the rig and its trim.
std::string text_of(const fs::path& rig) {
  return read_text_file(rig, kMaxFileBytes) + "\n# trim\n" + text_or_nothing(trim_file_of(rig));
}

std::optional<TrimmedRig> valid(const fs::path& rig) {
  try {
    return load_rig_and_identity(rig);
  } catch (const Error&) {
    return std::nullopt;
  }
}

}  // namespace

Rig parse_rig(std::string_view text, const std::string& source) {
  const toml::table root = parse_toml(text, source);
  const Rig rig = read_rig(TomlSection(root, {}, source));
  if (const auto problem = find_problem(rig)) {
    throw input_error("{}:{}: {}: {}", source, line_of(root, problem->key), problem->key,
                      problem->cause)
        .remedy(problem->remedy);
  }
  return rig;
}

Rig load_rig(const std::filesystem::path& file) {
  return parse_rig(read_text_file(file, kMaxFileBytes), file.string());
}

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
  for (const auto& [key, text] : rig.provenance)
    out += fmt::format("{} = {}\n", key_text(key), toml_string(text));
  return out;
}

void save_rig(const Rig& rig, const std::filesystem::path& file) {
  write_text_file(file, rig_to_toml(rig));
}

fs::path save_with_history(const Rig& rig, const fs::path& file) {
  validate_rig(rig, file.string());
  std::error_code error;
  const auto status = std::filesystem::status(file, error);
  if (!std::filesystem::status_known(status))
    throw failed_error("{}: {}", file.string(), error.message());
  if (!std::filesystem::exists(status)) {
    save_rig(rig, file);
    return {};
  }
  const fs::path copy = copy_beside(file);
  RemovedAtEnd removed(copy);  // removes the copy if the file was not replaced
  save_rig(rig, file);
  removed.keep();
  return copy;
}

RigStore::RigStore(fs::path given, fs::path copy)
    : given_(std::move(given)), copy_(std::move(copy)), made_from_(copy_) {
  made_from_.replace_extension(".given");
}

RigStore::Marks RigStore::glance() const {
  return {mark_of(given_), mark_of(trim_file_of(given_))};
}

fs::path RigStore::in_use() const {
  try {
    return text_or_nothing(made_from_) == text_of(given_) && valid(copy_) ? copy_ : given_;
  } catch (const Error&) {
    return given_;
  }
}

bool RigStore::update() {
  seen_ = glance();
  if (in_use() == copy_) return false;
  const std::string text = text_of(given_);
  const Rig rig = load_rig(given_);
  validate_rig(trimmed(rig, load_trim(given_)), given_.string());
  // Until the last line, the copy is not the one of this text, and is made again after a failure.
  if (!valid(copy_) || !(load_rig(copy_) == rig)) (void)save_with_history(rig, copy_);
  save_trim(load_trim(given_), copy_);
  write_text_file(made_from_, text);
  return true;
}

bool RigStore::update_if_edited() { return !(glance() == seen_) && update(); }

bool RigStore::differs() const {
  if (in_use() != copy_) return false;
  const auto given = valid(given_);
  const auto own = valid(copy_);
  return given && own && !(given->rig == own->rig);
}

}  // namespace lenticule::optics
