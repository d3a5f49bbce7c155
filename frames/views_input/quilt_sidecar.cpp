// SPDX-License-Identifier: Apache-2.0
#include "frames/views_input/quilt_sidecar.h"

#include <fmt/format.h>

#include <array>
#include <cmath>
#include <span>

#include "base/error.h"
#include "base/file.h"
#include "optics/json_fields.h"

namespace lenticule::frames {
namespace {

constexpr const char* kColumns[] = {"columns", "cols", "tileX", "tilesX", "viewX", "quilt_columns"};
constexpr const char* kRows[] = {"rows", "tileY", "tilesY", "viewY", "quilt_rows"};
constexpr const char* kViews[] = {"viewCount", "view_count",       "viewTotal", "numViews",
                                  "num_views", "quilt_view_count", "views"};
constexpr const char* kAspect[] = {"aspect", "quiltAspect", "viewAspect", "quilt_aspect"};
constexpr const char* kInverted[] = {"invertViews", "invert_views", "inverted", "invert",
                                     "invView"};
constexpr const char* kBlackIsNear[] = {"depthInversion", "depth_inversion"};
constexpr const char* kChromaDepth[] = {"chromaDepth", "chroma_depth"};
constexpr const char* kIsDepth[] = {"isRGBD", "is_rgbd"};
constexpr const char* kDepthPlace[] = {"depthPosition", "depth_position", "depth_loc"};
/// Keys of the object that some tools put their quilt's keys into.
constexpr const char* kInside[] = {"quilt_settings", "quiltSettings", "quilt", "metadata"};
/// depth_loc as a number.
constexpr std::array kNumberedPlaces = {DepthPlace::Bottom, DepthPlace::Top, DepthPlace::Left,
                                        DepthPlace::Right};
constexpr double kMostDepthiness = 10.0;

/// Spellings reads one object of the file in the known spellings of its keys.
class Spellings {
 public:
  explicit Spellings(const optics::JsonFields& fields) : fields_(fields) {}

  /// Returns the first spelling that the object has, or null.
  [[nodiscard]] const char* spelled(std::span<const char* const> keys) const {
    for (const char* const key : keys)
      if (const nlohmann::json* const value = fields_.find(key);
          value != nullptr && !value->is_null())
        return key;
    return nullptr;
  }
  [[nodiscard]] std::optional<double> number(std::span<const char* const> keys) const {
    const char* const key = spelled(keys);
    return key == nullptr ? std::nullopt : std::optional(fields_.number(key));
  }
  [[nodiscard]] std::optional<int> count(std::span<const char* const> keys) const {
    const std::optional<double> value = number(keys);
    if (!value) return std::nullopt;
    if (!(*value >= 1.0 && *value <= kMaxViews && *value == std::floor(*value)))
      fields_.fail(spelled(keys), fmt::format("not a whole number from 1 to {}", kMaxViews));
    return static_cast<int>(*value);
  }
  [[nodiscard]] bool flag(std::span<const char* const> keys) const {
    const char* const key = spelled(keys);
    return key != nullptr && fields_.flag(key);
  }
  [[nodiscard]] const optics::JsonFields& fields() const { return fields_; }

 private:
  const optics::JsonFields& fields_;
};

/// Returns the aspect; zero and negative numbers mean the aspect of the pixels.
std::optional<double> aspect_of(const Spellings& said) {
  const std::optional<double> aspect = said.number(kAspect);
  if (!aspect || *aspect <= 0.0) return std::nullopt;
  return aspect;
}

DepthPlace depth_place(const Spellings& said) {
  const char* const key = said.spelled(kDepthPlace);
  if (key == nullptr) return DepthPlace::Right;
  const nlohmann::json& value = *said.fields().find(key);
  if (value.is_string())
    if (const auto place = parse_depth_place(value.get_ref<const std::string&>())) return *place;
  if (value.is_number()) {
    const double number = said.fields().number(key);
    for (size_t n = 0; n < kNumberedPlaces.size(); ++n)
      if (number == static_cast<double>(n)) return kNumberedPlaces[n];
  }
  said.fields().fail(key, "neither right, left, bottom, top nor 0 to 3");
}

void read_depth(const Spellings& said, QuiltSidecar& sidecar) {
  if (said.spelled(kIsDepth) == nullptr || !said.flag(kIsDepth)) return;
  if (said.flag(kChromaDepth))
    said.fields().fail(said.spelled(kChromaDepth), "depth coded as colour is not supported");
  sidecar.depth = depth_place(said);
  sidecar.black_is_near = said.flag(kBlackIsNear);
  sidecar.depthiness = said.fields().number_or("depthiness", 1.0);
  if (!(sidecar.depthiness >= 0.0 && sidecar.depthiness <= kMostDepthiness))
    said.fields().fail("depthiness", fmt::format("not from 0 to {}", kMostDepthiness));
}

void read_quilt_keys(const Spellings& said, QuiltSidecar& sidecar) {
  sidecar.columns = said.count(kColumns);
  sidecar.rows = said.count(kRows);
  if (sidecar.columns.has_value() != sidecar.rows.has_value())
    said.fields().fail(sidecar.columns ? "rows" : "columns", "missing");
  sidecar.views = said.count(kViews);
  sidecar.aspect = aspect_of(said);
  sidecar.inverted = said.flag(kInverted);
}

/// Reports a layout error as an error of the file, not of the command line.
void check_layout(const QuiltSidecar& sidecar, const std::string& source) {
  try {
    check_quilt_layout({.columns = sidecar.columns.value(),
                        .rows = sidecar.rows.value(),
                        .views = sidecar.views.value_or(0),
                        .aspect = sidecar.aspect},
                       source);
  } catch (const Error& error) {
    throw Error(ErrorKind::Input, error.what(), error.hint());
  }
}

/// Returns the object that has the keys: the document, or an object inside it.
const nlohmann::json& object_of(const nlohmann::json& document) {
  for (const char* const key : kInside)
    if (const auto inside = document.find(key); inside != document.end() && inside->is_object())
      return *inside;
  return document;
}

}  // namespace

std::optional<QuiltSidecar> parse_quilt_sidecar(std::string_view json, const std::string& source) {
  const nlohmann::json document = optics::parse_json(json, source);
  if (!document.is_object()) return std::nullopt;
  const optics::JsonFields outer(document, source);
  const optics::JsonFields inner(object_of(document), source);
  const Spellings said(inner), said_outside(outer);
  if (said.spelled(kColumns) == nullptr && said.spelled(kRows) == nullptr &&
      said_outside.spelled(kIsDepth) == nullptr)
    return std::nullopt;
  QuiltSidecar sidecar;
  read_depth(said_outside, sidecar);
  // Tools state, for a picture with depth, the grid of the quilt that they would make from the
  // picture, so the grid is ignored.
  if (sidecar.depth)
    sidecar.aspect = aspect_of(said);
  else
    read_quilt_keys(said, sidecar);
  if (!sidecar.depth && !sidecar.columns) return std::nullopt;
  if (sidecar.columns) check_layout(sidecar, source);
  return sidecar;
}

std::filesystem::path sidecar_of(const std::filesystem::path& picture) {
  return std::filesystem::path(picture).replace_extension(".json");
}

std::optional<QuiltSidecar> read_sidecar_of(const std::filesystem::path& picture) {
  const std::filesystem::path file = sidecar_of(picture);
  std::error_code ignored;
  if (file == picture || !std::filesystem::exists(file, ignored)) return std::nullopt;
  return parse_quilt_sidecar(read_text_file(file, kMaxSidecarBytes), file.string());
}

}  // namespace lenticule::frames
