// SPDX-License-Identifier: Apache-2.0
// Reads and writes picture files as bytes; PictureCodec interprets the bytes.
#include "frames/image_io.h"

#include <fmt/format.h>

#include <algorithm>
#include <atomic>
#include <cmath>
#include <optional>
#include <utility>

#include "base/error_kinds.h"
#include "base/file.h"
#include "base/numbers.h"
#include "frames/image_format.h"
#include "frames/picture_codec.h"
#include "frames/srgb.h"

namespace lenticule::frames {
namespace {

constexpr uint64_t kMaxFileBytes = uint64_t{2} << 30;

ImageFormat writable_format(const std::filesystem::path& file) {
  const ImageFormat format = format_of_extension(file.extension().string());
  switch (format) {
    case ImageFormat::Png:
    case ImageFormat::Tiff:
    case ImageFormat::Exr:
      return format;
    case ImageFormat::Pnm:
      if (file.extension() == ".ppm" || file.extension() == ".PPM") return format;
      break;
    default:
      break;
  }
  throw usage_error("{}: unknown picture format", file.string())
      .remedy("use a name that ends in .png, .tif, .tiff, .exr or .ppm");
}

class InThisProcess final : public PictureFileReader {
 public:
  PictureInfo probe(const std::filesystem::path& file) const override {
    const auto bytes = read_whole_file(file, kMaxFileBytes);
    return picture_codec(bytes, file.string()).probe(bytes, file.string());
  }
  void read(const EncodedPicture& picture, PictureSink& sink, PictureValues values) const override {
    std::vector<uint8_t> file;
    if (!picture.file.empty()) file = read_whole_file(picture.file, kMaxFileBytes);
    const std::span<const uint8_t> bytes = picture.file.empty() ? picture.bytes : file;
    picture_codec(bytes, picture.name).decode(bytes, picture.name, values, sink);
  }
};

std::atomic<const PictureFileReader*> chosen_reader{nullptr};

const PictureFileReader& reader() {
  static const InThisProcess in_this_process;
  const PictureFileReader* const chosen = chosen_reader.load();
  return chosen != nullptr ? *chosen : in_this_process;
}

void refuse_tags_of_woven(const std::filesystem::path& file, const PictureInfo& info) {
  constexpr double kSquare = 0.005;
  if (info.orientation != Orientation::Upright)
    throw input_error("{}: its orientation tag is {}, and woven frames are never rotated",
                      file.string(), static_cast<int>(info.orientation))
        .remedy("remove the tag, or rotate the views before they are woven");
  if (std::abs(info.pixel_aspect - 1.0) > kSquare)
    throw input_error(
        "{}: its pixels are tagged {:.3g} times as wide as high, and woven frames are never scaled",
        file.string(), info.pixel_aspect)
        .remedy("remove the tag, or scale the views before they are woven");
}

/// FrameSink fills a frame that it allocates only when the first rows are decoded, so that a header
/// with a false size costs no memory.
class FrameSink final : public PictureSink {
 public:
  FrameSink(const std::filesystem::path& file, WovenFrame& frame, PictureUse use,
            std::optional<FrameGeometry> expected)
      : file_(file), frame_(frame), use_(use), expected_(expected) {}

  void accept(const PictureInfo& info) override {
    if (use_ == PictureUse::Woven) refuse_tags_of_woven(file_, info);
    info_ = info;
    const FrameGeometry found = oriented_geometry(info.geometry, info.orientation);
    if (expected_ && found != *expected_)
      throw input_error("{}: {} x {} pixels where {} x {} are expected", file_.string(),
                        found.width, found.height, expected_->width, expected_->height)
          .remedy("all pictures must have one size");
  }
  std::span<uint8_t> rows(int y, int rows) override {
    WovenFrame& stored = turns() ? stored_ : frame_;
    if (stored.geometry() != info_.geometry) stored = WovenFrame(info_.geometry);
    const size_t row = info_.geometry.row_bytes();
    return stored.bytes().subspan(static_cast<size_t>(y) * row, static_cast<size_t>(rows) * row);
  }
  void finish() {
    if (!turns()) return;
    const FrameGeometry upright = oriented_geometry(info_.geometry, info_.orientation);
    if (frame_.geometry() != upright) frame_ = WovenFrame(upright);
    turn_upright(stored_.bytes(), info_.geometry, info_.orientation, frame_.bytes());
  }

 private:
  [[nodiscard]] bool turns() const { return info_.orientation != Orientation::Upright; }

  const std::filesystem::path& file_;
  WovenFrame& frame_;
  PictureUse use_;
  std::optional<FrameGeometry> expected_;
  PictureInfo info_;
  WovenFrame stored_;
};

/// TextureSink fills a texture, which it also allocates only when the first rows are decoded. A row
/// of texels that are means of several pixels is summed up in linear light.
class TextureSink final : public PictureSink {
 public:
  TextureSink(TextureImage& image, TextureContent content) : image_(image), content_(content) {}

  void accept(const PictureInfo& info) override {
    info_ = info;
    const auto side = [&](int pixels) { return (pixels - 1) / image_.reduced + 1; };
    image_ = {};
    for (;; image_.reduced *= 2) {
      image_.width = side(info.geometry.width);
      image_.height = side(info.geometry.height);
      if (uint64_t(image_.width) * uint64_t(image_.height) <= kMaxTexturePixels) break;
    }
  }
  std::span<uint8_t> rows(int y, int rows) override {
    if (image_.reduced > 1) {
      add_row();
      next_row_ = y;
      return resized(row_, 1, info_.geometry.width);
    }
    const size_t row = static_cast<size_t>(image_.width) * info_.pixel_bytes;
    return resized(image_, image_.height, image_.width)
        .subspan(row * static_cast<size_t>(y), row * static_cast<size_t>(rows));
  }
  void finish() {
    if (image_.reduced > 1) add_row();
  }

 private:
  std::span<uint8_t> resized(TextureImage& of, int height, int width) const {
    const size_t values = static_cast<size_t>(width) * static_cast<size_t>(height) * 4;
    if (info_.pixel_bytes == 4) {
      of.codes.resize(values);
      return of.codes;
    }
    of.rgba.resize(values);
    return {reinterpret_cast<uint8_t*>(of.rgba.data()), values * sizeof(float)};
  }

  /// Adds the row that was decoded, and writes the texels when it was their last one.
  void add_row() {
    if (next_row_ < 0) return;
    const FloatImage row = floats_of(std::move(row_), content_);
    const auto width = static_cast<size_t>(info_.geometry.width);
    const auto side = static_cast<size_t>(image_.reduced);
    sums_.resize(static_cast<size_t>(image_.width) * 4);
    for (size_t x = 0; x < width; ++x)
      for (size_t c = 0; c < 4; ++c) sums_[x / side * 4 + c] += row.rgba[x * 4 + c];
    const int rows = next_row_ % image_.reduced + 1;
    if (rows < image_.reduced && next_row_ + 1 < info_.geometry.height) return;
    (void)resized(image_, image_.height, image_.width);
    const size_t at = static_cast<size_t>(next_row_ / image_.reduced) * sums_.size();
    for (size_t n = 0; n < sums_.size(); ++n) {
      const size_t columns = std::min(side, width - n / 4 * side);
      const float mean = sums_[n] / static_cast<float>(columns * static_cast<size_t>(rows));
      const bool is_light = content_ == TextureContent::Colour && n % 4 != 3;
      if (image_.codes.empty())
        image_.rgba[at + n] = mean;
      else
        image_.codes[at + n] = is_light ? code_from_linear(mean) : code_from_encoded(mean);
    }
    sums_.clear();
  }

  TextureImage& image_;
  const TextureContent content_;
  PictureInfo info_;
  TextureImage row_;         ///< the row that is being decoded
  int next_row_ = -1;        ///< its number
  std::vector<float> sums_;  ///< sums of the texels of one row
};

TextureImage texture_of(const EncodedPicture& picture, TextureContent content, TexelPlace place) {
  return reader().texture(
      picture, content == TextureContent::Colour ? PictureValues::Colours : PictureValues::Data,
      place);
}

void read_into(const std::filesystem::path& file, WovenFrame& frame, PictureUse use,
               std::optional<FrameGeometry> expected) {
  FrameSink sink(file, frame, use, expected);
  reader().read(file, sink);
  sink.finish();
}

constexpr int kMaxDigits = 18;

[[noreturn]] void reject(const std::string& pattern, const char* cause) {
  throw usage_error("pattern '{}': {}", pattern, cause)
      .remedy("write one %d or %05d in the file's name, for example out/%05d.png");
}

bool is_digit(char c) { return c >= '0' && c <= '9'; }

/// Conversion holds the length of "%d" or "%0Nd" at the start of `text` and its N (0 if absent).
struct Conversion {
  size_t length = 0;
  int digits = 0;
};
std::optional<Conversion> parse_conversion(std::string_view text) {
  size_t end = 1;
  if (end < text.size() && text[end] == '0') ++end;
  const size_t digits_begin = end;
  while (end < text.size() && is_digit(text[end])) ++end;
  if (end >= text.size() || text[end] != 'd' || end - digits_begin > 2) return std::nullopt;
  // A pattern without the zero would pad with blanks; "%0d" has no padding.
  if (end > digits_begin && text[1] != '0') return std::nullopt;
  const auto digits = number_from<int>(text.substr(digits_begin, end - digits_begin));
  return Conversion{end + 1, digits.value_or(0)};
}

}  // namespace

TextureImage PictureFileReader::texture(const EncodedPicture& picture, PictureValues values,
                                        TexelPlace) const {
  TextureImage image;
  TextureSink sink(
      image, values == PictureValues::Colours ? TextureContent::Colour : TextureContent::Data);
  read(picture, sink, values);
  sink.finish();
  return image;
}

void use_picture_reader(const PictureFileReader* reader) noexcept { chosen_reader.store(reader); }

void read_picture(const EncodedPicture& picture, PictureSink& sink) {
  reader().read(picture, sink);
}

WovenFrame read_woven(const std::filesystem::path& file, PictureUse use) {
  WovenFrame frame;
  read_into(file, frame, use, std::nullopt);
  return frame;
}

void read_woven_into(const std::filesystem::path& file, const FrameGeometry& expected,
                     WovenFrame& frame, PictureUse use) {
  read_into(file, frame, use, expected);
}

void read_woven_into(const std::filesystem::path& file, WovenFrame& frame) {
  read_into(file, frame, PictureUse::Woven, frame.geometry());
}

PictureInfo probe_picture(const std::filesystem::path& file, PictureUse use) {
  const PictureInfo info = reader().probe(file);
  if (use == PictureUse::Woven) refuse_tags_of_woven(file, info);
  return info;
}

FrameGeometry probe_image(const std::filesystem::path& file) {
  const PictureInfo info = probe_picture(file, PictureUse::Views);
  return oriented_geometry(info.geometry, info.orientation);
}

FrameGeometry oriented_geometry(const FrameGeometry& stored, Orientation orientation) {
  FrameGeometry turned = stored;
  if (orientation >= Orientation::Transposed) std::swap(turned.width, turned.height);
  return turned;
}

double upright_pixel_aspect(const PictureInfo& info) {
  return info.orientation >= Orientation::Transposed ? 1.0 / info.pixel_aspect : info.pixel_aspect;
}

void turn_upright(std::span<const uint8_t> stored, const FrameGeometry& geometry,
                  Orientation orientation, std::span<uint8_t> upright) {
  const FrameGeometry to = oriented_geometry(geometry, orientation);
  const bool swaps = orientation >= Orientation::Transposed;
  // True if stored columns (rows) are counted from the far end.
  const bool from_right =
      orientation == Orientation::Mirrored || orientation == Orientation::HalfTurn ||
      orientation == Orientation::Transversed || orientation == Orientation::ThreeQuarterTurn;
  const bool from_bottom =
      orientation == Orientation::HalfTurn || orientation == Orientation::UpsideDown ||
      orientation == Orientation::QuarterTurn || orientation == Orientation::Transversed;
  LENTICULE_CHECK(stored.size() == geometry.frame_bytes() && upright.size() == stored.size());
  uint8_t* out = upright.data();
  for (int y = 0; y < to.height; ++y) {
    for (int x = 0; x < to.width; ++x, out += 3) {
      int column = swaps ? y : x;
      int row = swaps ? x : y;
      if (from_right) column = geometry.width - 1 - column;
      if (from_bottom) row = geometry.height - 1 - row;
      const uint8_t* const in = stored.data() + static_cast<size_t>(row) * geometry.row_bytes() +
                                static_cast<size_t>(column) * 3;
      std::copy(in, in + 3, out);
    }
  }
}

TextureImage read_texture(const std::filesystem::path& file, TextureContent content,
                          TexelPlace place) {
  return texture_of(file, content, place);
}

TextureImage read_texture(std::span<const uint8_t> encoded, const std::string& name,
                          TextureContent content, TexelPlace place) {
  return texture_of({encoded, name}, content, place);
}

FloatImage floats_of(TextureImage image, TextureContent content) {
  FloatImage out{image.width, image.height, std::move(image.rgba)};
  if (image.codes.empty()) return out;
  const bool is_colour = content == TextureContent::Colour;
  out.rgba.resize(image.codes.size());
  for (size_t n = 0; n < image.codes.size(); ++n) {
    const uint8_t code = image.codes[n];
    out.rgba[n] = is_colour && n % 4 != 3 ? static_cast<float>(linear_of_codes()[code])
                                          : static_cast<float>(code) / 255.0F;
  }
  return out;
}

void check_writable_format(const std::filesystem::path& file) {
  static_cast<void>(writable_format(file));
}

void write_woven(const FrameView& frame, const std::filesystem::path& file) {
  const ImageFormat format = writable_format(file);
  if (frame.geometry.format != PixelFormat::Rgb8 || frame.geometry.width < 1 ||
      frame.geometry.height < 1)
    throw failed_error("{}: only 8-bit RGB frames can be written", file.string());
  LENTICULE_CHECK(frame.bytes.size() == frame.geometry.frame_bytes());
  write_file_atomically(file, picture_codec(format).encode(frame, format, file.string()));
}

// --- numbered file names: "dir/%05d.png"

FilePattern::FilePattern(std::string pattern) : pattern_(std::move(pattern)) {
  const size_t percent = pattern_.find('%');
  if (percent == std::string::npos) reject(pattern_, "no %d");
  const auto conversion = parse_conversion(std::string_view(pattern_).substr(percent));
  if (!conversion) reject(pattern_, "neither %d nor %0Nd");
  if (conversion->digits > kMaxDigits) reject(pattern_, "too many digits");
  prefix_ = pattern_.substr(0, percent);
  suffix_ = pattern_.substr(percent + conversion->length);
  digits_ = conversion->digits;
  if (suffix_.find('%') != std::string::npos) reject(pattern_, "more than one %");
  if (suffix_.find('/') != std::string::npos)
    reject(pattern_, "the number is not in the file name");
}

std::filesystem::path FilePattern::path(uint64_t number) const {
  return fmt::format("{}{:0{}}{}", prefix_, number, digits_, suffix_);
}

bool FilePattern::looks_like_pattern(std::string_view text) {
  return text.find('%') != std::string_view::npos;
}

std::vector<FilePattern::Named> FilePattern::similar() const {
  const std::filesystem::path prefix(prefix_);
  const std::filesystem::path folder = prefix.has_parent_path() ? prefix.parent_path() : ".";
  const std::string stem = prefix.filename().string();

  std::vector<Named> found;
  for (const std::filesystem::path& entry : entries_of(folder)) {
    const std::string name = entry.filename().string();
    if (name.size() <= stem.size() + suffix_.size() || !name.starts_with(stem) ||
        !name.ends_with(suffix_))
      continue;
    const size_t digits = name.size() - stem.size() - suffix_.size();
    const auto number = number_from<uint64_t>(std::string_view(name).substr(stem.size(), digits));
    if (number) found.push_back({*number, digits});
  }
  return found;
}

std::vector<uint64_t> FilePattern::existing() const {
  std::vector<uint64_t> numbers;
  const auto printed = [this](uint64_t number) {
    return fmt::formatted_size("{:0{}}", number, digits_);
  };
  for (const Named& one : similar())
    // Excludes names such as "7.png", which "%05d.png" does not produce.
    if (printed(one.number) == one.digits) numbers.push_back(one.number);
  std::sort(numbers.begin(), numbers.end());
  return numbers;
}

std::vector<uint64_t> FilePattern::existing_or_throw() const {
  std::vector<uint64_t> numbers = existing();
  if (!numbers.empty()) return numbers;
  const std::vector<Named> others = similar();
  throw input_error("{}: no such files", pattern_)
      .remedy(others.empty()
                  ? "%05d stands for a number of five digits, %d for one of any length"
                  : fmt::format("there are files with {} digits: '{}%0{}d{}'",
                                others.front().digits, prefix_, others.front().digits, suffix_));
}

}  // namespace lenticule::frames
