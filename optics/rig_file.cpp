// SPDX-License-Identifier: Apache-2.0
// Reads rig files; rig_file_write.cpp writes them.
#include "optics/rig_file.h"

#include <fmt/format.h>

#include <algorithm>
#include <initializer_list>
#include <limits>

#include "base/error.h"
#include "base/file.h"
#include "base/text.h"
#include "optics/toml_text.h"

namespace lenticule::optics {
namespace {

constexpr size_t kMaxFileBytes = 16u << 20;
constexpr int64_t kFormat = 1;

/// Section is one table of the file: it reads members by key and reports errors with
/// "source:line:".
class Section {
 public:
  Section(const toml::table& table, std::string name, const std::string& source)
      : table_(table), name_(std::move(name)), source_(source) {}

  [[noreturn]] void fail(const toml::node& at, const std::string& cause,
                         const std::string& remedy = {}) const {
    fail(at.source().begin.line, cause, remedy);
  }

  /// Throws for a key that is not in the list, and names the most similar key of the list.
  void allow_only(std::initializer_list<std::string_view> known) const {
    for (const auto& [key, value] : table_) {
      const std::string_view word = key.str();
      if (std::find(known.begin(), known.end(), word) != known.end()) continue;
      const auto nearest = nearest_word(word, {known.begin(), known.size()});
      fail(key.source().begin.line, fmt::format("unknown key '{}'", full_name(clipped(word))),
           nearest ? fmt::format("did you mean '{}'?", *nearest) : std::string());
    }
  }

  [[nodiscard]] const toml::node* find(std::string_view key) const { return table_.get(key); }

  [[nodiscard]] const toml::node& get(std::string_view key) const {
    if (const toml::node* node = find(key)) return *node;
    fail(table_.source().begin.line, fmt::format("key '{}' is missing", full_name(key)));
  }

  [[nodiscard]] double number(std::string_view key) const { return number_of(get(key), key); }
  [[nodiscard]] double number_or(std::string_view key, double otherwise) const {
    return find(key) != nullptr ? number(key) : otherwise;
  }

  [[nodiscard]] double number_of(const toml::node& node, std::string_view key) const {
    if (const auto* real = node.as_floating_point()) return real->get();
    if (const auto* whole = node.as_integer()) return static_cast<double>(whole->get());
    fail(node, fmt::format("'{}' is not a number", full_name(key)));
  }

  /// Reads a whole number of a plausible size; the validator checks the exact limits.
  [[nodiscard]] int whole(std::string_view key) const {
    return static_cast<int>(whole_within(key, -1'000'000, 1'000'000));
  }

  [[nodiscard]] int64_t whole_within(std::string_view key, int64_t low, int64_t high) const {
    const toml::node& node = get(key);
    const auto* value = node.as_integer();
    if (value == nullptr) fail(node, fmt::format("'{}' is not a whole number", full_name(key)));
    if (value->get() < low || value->get() > high) {
      fail(node, fmt::format("'{}' is not within {} to {}", full_name(key), low, high));
    }
    return value->get();
  }

  [[nodiscard]] std::string text_or(std::string_view key, const std::string& otherwise) const {
    const toml::node* node = find(key);
    return node != nullptr ? text_of(*node, key) : otherwise;
  }

  [[nodiscard]] std::string text_of(const toml::node& node, std::string_view key) const {
    if (const auto* text = node.as_string()) return text->get();
    fail(node, fmt::format("'{}' is not a string in quotes", full_name(key)));
  }

  [[nodiscard]] const toml::array& array(std::string_view key) const {
    const toml::node& node = get(key);
    if (const toml::array* list = node.as_array()) return *list;
    fail(node, fmt::format("'{}' is not a list in [ ]", full_name(key)));
  }

  [[nodiscard]] std::vector<double> numbers(const toml::array& list, std::string_view key) const {
    std::vector<double> out;
    out.reserve(list.size());
    for (const toml::node& item : list) out.push_back(number_of(item, key));
    return out;
  }

  [[nodiscard]] Section section(std::string_view key) const {
    const toml::node& node = get(key);
    if (const toml::table* table = node.as_table()) return {*table, full_name(key), source_};
    fail(node, fmt::format("'{}' is not a section", full_name(key)));
  }

  [[nodiscard]] std::string full_name(std::string_view key) const {
    return name_.empty() ? std::string(key) : fmt::format("{}.{}", name_, key);
  }

  [[nodiscard]] const toml::table& table() const { return table_; }

 private:
  [[noreturn]] void fail(toml::source_index line, const std::string& cause,
                         const std::string& remedy) const {
    throw Error(ErrorKind::Input, fmt::format("{}:{}: {}", source_, std::max(line, 1u), cause),
                remedy);
  }
  [[noreturn]] void fail(toml::source_index line, const std::string& cause) const {
    fail(line, cause, {});
  }

  static std::string_view clipped(std::string_view word) { return word.substr(0, 64); }

  const toml::table& table_;
  std::string name_;
  const std::string& source_;
};

SubpixelLayout read_cells(const Section& layout) {
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

SubpixelLayout read_layout(const Section& panel) {
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

Mounting read_mounting(const Section& panel) {
  const toml::node* node = panel.find("mounting");
  if (node == nullptr) return {};
  const std::string name = panel.text_of(*node, "mounting");
  try {
    return mounting_named(name);
  } catch (const Error& error) {
    panel.fail(*node, error.what(), error.hint());
  }
}

Panel read_panel(const Section& panel) {
  panel.allow_only(
      {"width_px", "height_px", "pixel_width_mm", "pixel_height_mm", "layout", "mounting"});
  return {.width_px = panel.whole("width_px"),
          .height_px = panel.whole("height_px"),
          .pixel_width = Millimetres(panel.number("pixel_width_mm")),
          .pixel_height = Millimetres(panel.number("pixel_height_mm")),
          .layout = read_layout(panel),
          .mounting = read_mounting(panel)};
}

ResidualMap read_residual(const Section& sheet) {
  if (sheet.find("residual") == nullptr) return {};
  const Section residual = sheet.section("residual");
  residual.allow_only({"columns", "rows", "lenses"});
  ResidualMap map{.columns = residual.whole("columns"),
                  .rows = residual.whole("rows"),
                  .lenses = residual.numbers(residual.array("lenses"), "lenses")};
  if (map.empty()) residual.fail(residual.get("lenses"), "'sheet.residual.lenses' is empty");
  return map;
}

std::array<Subpixels, 3> read_channel_offset(const Section& sheet) {
  constexpr std::string_view kKey = "channel_offset_subpx";
  if (sheet.find(kKey) == nullptr) return {};
  const toml::array& list = sheet.array(kKey);
  if (list.size() != 3) sheet.fail(list, "'sheet.channel_offset_subpx' is not [red, green, blue]");
  const std::vector<double> v = sheet.numbers(list, kKey);
  return {Subpixels(v[0]), Subpixels(v[1]), Subpixels(v[2])};
}

LensSheet read_sheet(const Section& sheet) {
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

ViewingLine read_viewing(const Section& root) {
  const ViewingLine standard;
  if (root.find("viewing") == nullptr) return standard;
  const Section viewing = root.section("viewing");
  viewing.allow_only({"distance_mm", "height_mm"});
  return {.height = Millimetres(viewing.number_or("height_mm", standard.height.value)),
          .distance = Millimetres(viewing.number_or("distance_mm", standard.distance.value))};
}

PanelIdentity read_identity(const Section& root) {
  PanelIdentity identity;
  if (root.find("identity") == nullptr) return identity;
  const Section section = root.section("identity");
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
std::vector<std::pair<std::string, std::string>> read_provenance(const Section& root) {
  if (root.find("provenance") == nullptr) return {};
  const Section section = root.section("provenance");
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

Rig read_rig(const Section& root) {
  root.allow_only({"format", "name", "panel", "sheet", "viewing", "identity", "provenance"});
  if (root.whole_within("format", 0, std::numeric_limits<int64_t>::max()) != kFormat) {
    root.fail(root.get("format"), "unknown format; expected 1",
              "it was made by a newer version of this program");
  }
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
  const Rig rig = read_rig(Section(root, {}, source));
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

}  // namespace lenticule::optics
