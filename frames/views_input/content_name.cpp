// SPDX-License-Identifier: Apache-2.0
#include "frames/views_input/content_name.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cctype>
#include <limits>
#include <utility>
#include <vector>

#include "base/error_kinds.h"
#include "base/file.h"
#include "base/text.h"
#include "frames/exif_tags.h"
#include "optics/json_fields.h"

namespace lenticule::frames {
namespace {

/// The words of each layout, with blanks around them.
constexpr std::pair<std::string_view, StereoLayout> kStereoWords[] = {
    {" sbs fsbs lr 2x1 3dh sidebyside leftright ", {.beside = true}},
    {" hsbs lrh lrq ", {.beside = true, .half = true}},
    {" rl rightleft ", {.beside = true, .right_first = true}},
    {" rlh rlq ", {.beside = true, .half = true, .right_first = true}},
    {" tb tab ftab ou fou 1x2 3dv topbottom overunder ", {.beside = false}},
    {" htb htab hou tbh tbq ", {.beside = false, .half = true}},
    {" bt bottomtop ", {.beside = false, .right_first = true}},
};

std::optional<StereoLayout> stereo_word(const std::string& word) {
  for (const auto& [words, layout] : kStereoWords)
    if (words.find(" " + word + " ") != std::string_view::npos) return layout;
  return std::nullopt;
}

/// Returns the words of the name in lower case, without the extension.
std::vector<std::string> words_of(const std::filesystem::path& file) {
  std::vector<std::string> words(1);
  bool small = false;
  for (const char c : file.stem().string()) {
    const bool capital = c >= 'A' && c <= 'Z';
    const bool between = c == '_' || c == '-' || c == '.' || c == ' ';
    if (between || (small && capital)) words.emplace_back();
    if (!between) words.back() += capital ? static_cast<char>(c - 'A' + 'a') : c;
    small = c >= 'a' && c <= 'z';
  }
  return words;
}

bool has_extension(const std::filesystem::path& file, std::string_view extension) {
  return lower_case(file.extension().string()) == extension;
}

bool means_half(const std::vector<std::string>& words, size_t at) {
  return at < words.size() && (words[at] == "half" || words[at] == "h");
}

/// Tags precede the coded picture; a camera's preview may precede the tags.
constexpr size_t kHeadBytes = size_t{1} << 20;

/// Returns the first bytes of a file.
std::vector<uint8_t> read_head(const std::filesystem::path& file, size_t bytes) {
  const OpenedFile opened = open_regular_file(file, std::numeric_limits<uint64_t>::max());
  std::vector<uint8_t> head(std::min<uint64_t>(opened.bytes, bytes));
  const ssize_t n = read_from_start(opened.descriptor.get(), head);
  head.resize(static_cast<size_t>(std::max<ssize_t>(n, 0)));
  return head;
}

constexpr std::string_view kInComment = "LKGColumns";
constexpr const char* kColumns[] = {"columns", "cols",          "tileX",          "tilesX",
                                    "viewX",   "quilt_columns", kInComment.data()};
constexpr const char* kRows[] = {"rows", "tileY", "tilesY", "viewY", "quilt_rows", "LKGRows"};
constexpr const char* kViews[] = {"viewCount", "view_count",       "viewTotal", "numViews",
                                  "num_views", "quilt_view_count", "views",     "LKGNumViews"};
constexpr const char* kAspect[] = {"aspect", "quiltAspect", "viewAspect", "quilt_aspect",
                                   "LKGAspect"};
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
      if (fields_.find(key) != nullptr) return key;
    return nullptr;
  }
  [[nodiscard]] std::optional<double> number(std::span<const char* const> keys) const {
    const char* const key = spelled(keys);
    return key == nullptr ? std::nullopt : std::optional(fields_.number(key));
  }
  [[nodiscard]] std::optional<int> count(std::span<const char* const> keys) const {
    const char* const key = spelled(keys);
    return key == nullptr ? std::nullopt : std::optional(fields_.count(key, kMaxViews));
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
    if (const auto layout = parse_depth_layout(value.get_ref<const std::string&>()))
      return layout->place;
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

StereoLayout parse_stereo(const std::string& text) {
  // The first word of a name never counts, and no extension counts here.
  if (const auto layout = stereo_of_name("_" + text + "_")) return *layout;
  throw usage_error("--stereo '{}': unknown", text)
      .remedy("use sbs, tb, hsbs (half width), htb (half height) or none");
}

std::optional<StereoLayout> stereo_of_name(const std::filesystem::path& file) {
  const std::vector<std::string> words = words_of(file);
  for (size_t at = 1; at < words.size(); ++at) {
    std::optional<StereoLayout> layout = stereo_word(words[at]);
    size_t last = at;
    if (!layout && at + 1 < words.size()) layout = stereo_word(words[at] + words[++last]);
    if (!layout) continue;
    layout->half = layout->half || means_half(words, at - 1) || means_half(words, last + 1);
    return layout;
  }
  if (has_extension(file, ".pns") || is_jps_name(file))
    return StereoLayout{.beside = true, .right_first = true};
  return std::nullopt;
}

StereoTiles tiles_of(const StereoLayout& stereo, const FrameGeometry& picture) {
  StereoTiles tiles;
  tiles.layout =
      stereo.beside ? QuiltLayout{.columns = 2, .rows = 1} : QuiltLayout{.columns = 1, .rows = 2};
  tiles.rightmost_first = stereo.beside == stereo.right_first;
  if (stereo.half) tiles.layout.aspect = static_cast<double>(picture.width) / picture.height;
  return tiles;
}

std::optional<DepthLayout> parse_depth_layout(std::string_view text) {
  constexpr std::array kPlaces = {"right", "left", "bottom", "top"};  // in the order of the types
  constexpr std::array kParts = {"", ":half", ":quarter"};
  for (size_t place = 0; place < kPlaces.size(); ++place)
    for (size_t part = 0; part < kParts.size(); ++part)
      if (text == std::string(kPlaces[place]) + kParts[part])
        return DepthLayout{static_cast<DepthPlace>(place), static_cast<DepthPart>(part)};
  return std::nullopt;
}

DepthWindows depth_windows(const FrameGeometry& picture, const DepthLayout& layout,
                           const std::string& name) {
  const auto [place, part] = layout;
  const bool beside = place == DepthPlace::Right || place == DepthPlace::Left;
  const int along = beside ? picture.width : picture.height;
  const int depth = part == DepthPart::Whole ? along / 2 : along / 3;
  const int colour = part == DepthPart::Whole ? depth : 2 * depth;
  const int across = beside ? picture.height : picture.width;
  const int depth_across = part == DepthPart::Quarter ? across / 2 : across;
  if (depth < 1 || depth_across < 1)
    throw input_error("{}: {} x {} pixels are too few for colours and depth", name, picture.width,
                      picture.height);
  const bool depth_first = place == DepthPlace::Left || place == DepthPlace::Top;
  const int unused = beside ? 0 : along - colour - depth;
  const auto window = [&](int begin, int length, int breadth) {
    return beside ? DepthWindows::Window{.left = begin, .size = {length, breadth}}
                  : DepthWindows::Window{.top = begin, .size = {breadth, length}};
  };
  return {.colour = window(unused + (depth_first ? depth : 0), colour, across),
          .depth = window(unused + (depth_first ? 0 : colour), depth, depth_across)};
}

bool mentions_quilt(const std::filesystem::path& file) {
  return std::ranges::any_of(words_of(file), [](const std::string& word) {
    return word.starts_with("qs") &&
           (word.size() == 2 || std::isdigit(static_cast<unsigned char>(word[2])) != 0);
  });
}

bool is_rgbd_name(const std::filesystem::path& file) {
  const std::vector<std::string> words = words_of(file);
  return std::find(words.begin() + 1, words.end(), "rgbd") != words.end();
}

bool is_jps_name(const std::filesystem::path& file) { return has_extension(file, ".jps"); }

std::optional<StereoLayout> parse_jps_tag(std::span<const uint8_t> head, const std::string& name) {
  // Two bytes of length, then separation, flags, layout and type.
  constexpr size_t kDescriptorBytes = 6;
  constexpr uint8_t kHalfHeight = 1, kHalfWidth = 2, kLeftFirst = 4;
  constexpr uint8_t kStereoscopic = 1, kBeside = 2, kAbove = 3;
  const std::span<const uint8_t> descriptor = jpeg_segment(head, 0xE3, "_JPSJPS_");
  if (descriptor.size() < kDescriptorBytes) return std::nullopt;
  const uint8_t flags = descriptor[3], layout = descriptor[4], type = descriptor[5];
  if (type != kStereoscopic)
    throw input_error("{}: its tag says that it is not stereoscopic", name)
        .remedy("use --stereo none to show it unchanged");
  if (layout != kBeside && layout != kAbove)
    throw Error(
        ErrorKind::Input,
        fmt::format("{}: its tag says {}; only side by side and top and bottom are supported", name,
                    layout == 1 ? "interlaced rows" : "an unknown layout"),
        "convert it to side by side");
  const bool beside = layout == kBeside;
  const bool half = (flags & (beside ? kHalfWidth : kHalfHeight)) != 0;
  return StereoLayout{.beside = beside, .half = half, .right_first = (flags & kLeftFirst) == 0};
}

std::optional<StereoLayout> read_jps_tag(const std::filesystem::path& file) {
  return parse_jps_tag(read_head(file, kHeadBytes), file.string());
}

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
  sidecar.zoom = outer.number_or("zoom", 1.0);
  sidecar.duration_s = outer.number_or("duration", 0.0);
  if (*sidecar.duration_s <= 0.0) sidecar.duration_s.reset();
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
  const std::filesystem::path appended = picture.string() + ".json";
  std::error_code ignored;
  if (std::filesystem::exists(appended, ignored)) return appended;
  return std::filesystem::path(picture).replace_extension(".json");
}

std::optional<QuiltSidecar> read_sidecar_of(const std::filesystem::path& picture) {
  const std::filesystem::path file = sidecar_of(picture);
  std::error_code ignored;
  if (file == picture || !std::filesystem::exists(file, ignored)) return std::nullopt;
  return parse_quilt_sidecar(read_text_file(file, kMaxSidecarBytes), file.string());
}

std::optional<QuiltSidecar> read_quilt_comment(const std::filesystem::path& picture) {
  // An EXIF block is at the start of a picture and has at most 64 KiB.
  constexpr size_t kCommentBytes = size_t{1} << 16;
  std::error_code ignored;
  if (!std::filesystem::is_regular_file(picture, ignored)) return std::nullopt;
  std::vector<uint8_t> bytes = read_head(picture, kCommentBytes);
  std::erase(bytes, 0);  // the comment may be UTF-16; JSON with these keys is ASCII
  const std::string_view head(reinterpret_cast<const char*>(bytes.data()), bytes.size());
  const size_t key = head.find(kInComment);
  const size_t begin = key == std::string::npos ? key : head.rfind('{', key);
  const size_t end = begin == std::string::npos ? begin : head.find('}', key);
  if (end == std::string::npos) return std::nullopt;
  return parse_quilt_sidecar(head.substr(begin, end + 1 - begin),
                             picture.string() + ": its comment");
}

}  // namespace lenticule::frames
