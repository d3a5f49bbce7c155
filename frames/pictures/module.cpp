// SPDX-License-Identifier: Apache-2.0
// The picture codec that the lazily loaded library exports: decodes and encodes pictures with
// OpenImageIO, in memory. Every feature that would change a code value is off; a single place of
// the caller writes encoded bytes to the disk and detects every failure.
#include <OpenImageIO/filesystem.h>
#include <OpenImageIO/imageio.h>
#include <fmt/format.h>
#include <libheif/heif.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <filesystem>
#include <memory>
#include <mutex>
#include <optional>
#include <span>
#include <string_view>
#include <tuple>
#include <vector>

#include "base/error_kinds.h"
#include "base/misnamed_file.h"
#include "base/owned.h"
#include "base/text.h"
#include "frames/image_format.h"
#include "frames/picture_codec.h"
#include "frames/srgb.h"

namespace lenticule::frames::pictures {
namespace {

/// Configures OpenImageIO, for the whole process, to start no threads and to refuse huge
/// allocations, and prepares libheif. Cheap after the first call.
///
/// Thread safety: any thread.
void set_up_libraries() {
  static std::once_flag once;
  std::call_once(once, [] {
    OIIO::attribute("threads", 1);
    OIIO::attribute("exr_threads", -1);
    OIIO::attribute("limits:imagesize_MB", 8192);
    OIIO::attribute("limits:channels", 64);
    // Loads the plug-ins of libheif, which a confined process could not open.
    (void)heif_init(nullptr);
  });
}

// --- HEIF

using Bytes = std::span<const uint8_t>;

/// Returns the number of `bytes` bytes at the start; the caller checks that there are as many.
uint64_t big_endian(Bytes in, size_t bytes) {
  uint64_t value = 0;
  for (const uint8_t byte : in.first(bytes)) value = value << 8 | byte;
  return value;
}

/// Returns the content of the first box of that type; empty if there is none.
Bytes box_in(Bytes in, std::string_view type) {
  constexpr size_t kHead = 8, kLongHead = 16;
  while (in.size() >= kHead) {
    uint64_t size = big_endian(in, 4);
    const bool is_long = size == 1;  // the size follows in 8 bytes
    if (is_long && in.size() < kLongHead) return {};
    if (is_long) size = big_endian(in.subspan(kHead), 8);
    if (size == 0) size = in.size();  // up to the end
    const size_t head = is_long ? kLongHead : kHead;
    if (size < head || size > in.size()) return {};
    if (std::ranges::equal(in.subspan(4, 4), type)) return in.subspan(head, size - head);
    in = in.subspan(size);
  }
  return {};
}

/// Returns the item numbers of the pictures for the left and the right eye: those of the first
/// group of the kind `ster` (ISO/IEC 23008-12, 6.8.5), as phones and headsets write it. Returns
/// nothing for damaged boxes.
std::optional<std::array<uint32_t, 2>> eyes_in_heif(Bytes file) {
  // The box `meta` begins with a version. In `ster` come, in 4 bytes each, a version, the group's
  // number, the number of pictures, and the pictures' numbers.
  constexpr size_t kVersion = 4, kCount = 8, kLeft = 12, kRight = 16, kEnd = 20;
  const Bytes meta = box_in(file, "meta");
  if (meta.size() < kVersion) return std::nullopt;
  const Bytes group = box_in(box_in(meta.subspan(kVersion), "grpl"), "ster");
  if (group.size() < kEnd || big_endian(group.subspan(kCount), 4) != 2) return std::nullopt;
  const auto item = [&](size_t at) {
    return static_cast<uint32_t>(big_endian(group.subspan(at), 4));
  };
  return std::array{item(kLeft), item(kRight)};
}

using Context = Owned<heif_context, heif_context_free>;
using Handle = Owned<heif_image_handle, heif_image_handle_release>;
using Options = Owned<heif_decoding_options, heif_decoding_options_free>;
using Image = Owned<heif_image, heif_image_release>;

/// Subimages of the reader; the last two exist if the file has two eyes' pictures.
enum HeifPicture { kHeifPrimary, kHeifLeft, kHeifRight };

/// HeifReader reads HEIF, which phones write as .heic, and AVIF with libheif. OpenImageIO's own
/// reader takes files by their names only, and knows no pairs of pictures. Pictures are upright and
/// have 8 bits.
///
/// Lifetime: the bytes must outlive the reader.
class HeifReader final : public OIIO::ImageInput {
 public:
  explicit HeifReader(Bytes file) : file_(file) {}

  [[nodiscard]] const char* format_name() const override { return "heif"; }
  [[nodiscard]] int current_subimage() const override { return picture_; }

  bool open(const std::string& /*name*/, OIIO::ImageSpec& spec) override {
    context_.reset(heif_context_alloc());
    heif_context_set_max_decoding_threads(context_.get(), 0);  // in this thread
    items_.resize(1);
    if (failed(heif_context_read_from_memory_without_copy(context_.get(), file_.data(),
                                                          file_.size(), nullptr)) ||
        failed(heif_context_get_primary_image_ID(context_.get(), items_.data())))
      return false;
    if (const auto eyes = eyes_in_heif(file_))
      items_.insert(items_.end(), eyes->begin(), eyes->end());
    if (!seek_subimage(kHeifPrimary, 0)) return false;
    spec = m_spec;
    return true;
  }

  bool seek_subimage(int picture, int level) override {
    if (level != 0 || picture < 0 || picture >= std::ssize(items_)) return false;
    if (handle_ && picture == picture_) return true;
    heif_image_handle* handle = nullptr;
    if (failed(heif_context_get_image_handle(context_.get(), items_[static_cast<size_t>(picture)],
                                             &handle)))
      return false;
    handle_.reset(handle);
    image_.reset();
    picture_ = picture;
    const bool alpha = heif_image_handle_has_alpha_channel(handle) != 0;
    m_spec =
        OIIO::ImageSpec(heif_image_handle_get_width(handle), heif_image_handle_get_height(handle),
                        alpha ? 4 : 3, OIIO::TypeDesc::UINT8);
    return true;
  }

  bool read_native_scanline(int picture, int level, int y, int /*z*/, void* data) override {
    if (!seek_subimage(picture, level) || (!image_ && !decode())) return false;
    const size_t row = m_spec.scanline_bytes();
    std::copy_n(pixels_ + static_cast<size_t>(y) * stride_, row, static_cast<uint8_t*>(data));
    return true;
  }

  bool close() override { return true; }

 private:
  bool failed(const heif_error& error) {
    if (error.code != heif_error_Ok) errorfmt("{}", error.message);
    return error.code != heif_error_Ok;
  }

  bool decode() {
    const Options options(heif_decoding_options_alloc());
    options->convert_hdr_to_8bit = 1;
    heif_image* image = nullptr;
    const bool alpha = m_spec.nchannels == 4;
    if (failed(heif_decode_image(handle_.get(), &image, heif_colorspace_RGB,
                                 alpha ? heif_chroma_interleaved_RGBA : heif_chroma_interleaved_RGB,
                                 options.get())))
      return false;
    image_.reset(image);
    int stride = 0;
    pixels_ = heif_image_get_plane_readonly(image, heif_channel_interleaved, &stride);
    stride_ = static_cast<size_t>(stride);
    const bool as_stated = pixels_ != nullptr &&
                           heif_image_get_width(image, heif_channel_interleaved) == m_spec.width &&
                           heif_image_get_height(image, heif_channel_interleaved) == m_spec.height;
    if (as_stated) return true;
    errorfmt("its pixels are not as many as its header states");
    image_.reset();
    return false;
  }

  Bytes file_;
  Context context_;
  std::vector<heif_item_id> items_;  ///< items of the pictures, by HeifPicture
  int picture_ = -1;
  Handle handle_;
  Image image_;  ///< decoded pixels of the picture, if any
  const uint8_t* pixels_ = nullptr;
  size_t stride_ = 0;
};

// --- decoding

constexpr int kMaxReadChannels = 4;

/// Sample is the type of decoded samples, after the decoder's own widening of odd bit depths.
enum class Sample { U8, U16, F32 };

/// Band holds rows [y, y + rows) with `channels` interleaved samples per pixel.
struct Band {
  int y = 0;
  int rows = 0;
  int channels = 0;
  Sample sample = Sample::U8;
  const uint8_t* data = nullptr;

  /// Returns `count` rows from row `first` on.
  [[nodiscard]] Band part(int first, int count, int width) const {
    const size_t sample_bytes = sample == Sample::U8 ? 1 : sample == Sample::U16 ? 2 : 4;
    const size_t row = static_cast<size_t>(width) * static_cast<size_t>(channels) * sample_bytes;
    return {y + first, count, channels, sample, data + static_cast<size_t>(first) * row};
  }
  /// Returns the channel of red, green or blue: one or two channels are grey (and alpha).
  [[nodiscard]] int colour_channel(int c) const { return channels >= 3 ? c : 0; }
};

/// PictureMemory records a read beyond the end: libtiff, reading through a proxy, takes the old
/// content of its buffer for the missing bytes.
class PictureMemory final : public OIIO::Filesystem::IOMemReader {
 public:
  using IOMemReader::IOMemReader;

  size_t read(void* out, size_t size) override { return note(IOMemReader::read(out, size), size); }
  size_t pread(void* out, size_t size, int64_t offset) override {
    return note(IOMemReader::pread(out, size, offset), size);
  }
  [[nodiscard]] bool ran_out() const { return ran_out_; }
  /// Forgets what the header's reader looked for beyond the end.
  void forget() { ran_out_ = false; }

 private:
  size_t note(size_t got, size_t wanted) {
    ran_out_ = ran_out_ || got < wanted;
    return got;
  }
  bool ran_out_ = false;
};

/// Returns what a file is that has no picture's mark.
MisnamedFile unknown_kind(std::string_view text, const std::string& extension) {
  constexpr std::array kModels{".glb", ".gltf", ".obj", ".fbx", ".ply", ".stl", ".dae", ".3ds"};
  if (text.empty()) return {"empty file", kPictureRemedy};
  if (const auto is = recognise_misnamed(text, extension)) return *is;
  if (text.starts_with("\x89LTS") || text.starts_with("\x1A\x45\xDF\xA3") ||
      text.starts_with("GIF8") || text.substr(std::min<size_t>(4, text.size()), 4) == "ftyp")
    return {"a film, not a picture",
            "take one out of it: lenticule convert FILM --frames 0 --grid 1x1 -o FRAME.png"};
  if (text.starts_with("glTF") || std::ranges::find(kModels, extension) != kModels.end())
    return {"a model, not a picture", "make one of it: lenticule render MODEL -o FRAME.png"};
  return {"not a picture of a known format", kPictureRemedy};
}

// --- colours of EXR files

using Triple = std::array<double, 3>;

Triple cross(const Triple& a, const Triple& b) {
  return {a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]};
}

double dot(const Triple& a, const Triple& b) { return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]; }

/// Returns the rows of the matrix from an EXR file's linear colours to those of sRGB, by way of CIE
/// XYZ; grey remains grey. Returns nothing if the file states no primaries, those of sRGB, or
/// impossible ones.
std::optional<std::array<Triple, 3>> to_srgb_primaries(const OIIO::ImageSpec& spec) {
  constexpr std::array<float, 8> kSrgb = {0.64F, 0.33F, 0.3F, 0.6F, 0.15F, 0.06F, 0.3127F, 0.329F};
  constexpr std::array<Triple, 3> kSrgbOfXyz = {{{3.2404542, -1.5371385, -0.4985314},
                                                 {-0.9692660, 1.8760108, 0.0415560},
                                                 {0.0556434, -0.2040259, 1.0572252}}};
  constexpr float kSame = 1e-3F;
  constexpr double kLeast = 1e-6;
  std::array<float, 8> stated{};
  if (!spec.getattribute("chromaticities", OIIO::TypeDesc(OIIO::TypeDesc::FLOAT, 8), stated.data()))
    return std::nullopt;
  const auto same = [](float a, float b) { return std::abs(a - b) < kSame; };
  if (std::ranges::equal(stated, kSrgb, same)) return std::nullopt;
  const auto xyz = [&](size_t at) -> Triple {
    const double x = double{stated[at]}, y = double{stated[at + 1]};
    return {x / y, 1.0, (1.0 - x - y) / y};
  };
  const std::array<Triple, 3> primaries = {xyz(0), xyz(2), xyz(4)};
  const Triple white = xyz(6);
  std::array<Triple, 3> rows{};
  for (size_t c = 0; c < 3; ++c) {
    const Triple normal = cross(primaries[(c + 1) % 3], primaries[(c + 2) % 3]);
    const double amount = dot(white, normal) / dot(primaries[c], normal);
    for (size_t row = 0; row < 3; ++row) rows[row][c] = amount * dot(kSrgbOfXyz[row], primaries[c]);
  }
  for (Triple& row : rows) {
    const double grey = row[0] + row[1] + row[2];
    for (double& factor : row) factor /= grey;
    if (!std::isfinite(dot(row, row)) || !(grey > kLeast)) return std::nullopt;
  }
  return rows;
}

/// Part is one of the pictures in a file.
struct Part {
  std::span<const uint8_t> bytes;
  int subimage = 0;
  int channel = 0;                  ///< the first one
  int channels = kMaxReadChannels;  ///< limit of their number
};

/// Returns the pictures of the left and the right eye in a camera's file of several JPEGs (CIPA
/// DC-007, multi-picture format): the first two that its index calls a disparity, of which the
/// first one begins the file.
std::vector<Part> eyes_in_jpeg(std::span<const uint8_t> file) {
  constexpr uint16_t kEntries = 0xB002;
  constexpr uint32_t kKind = 0xFFFFFF, kDisparity = 0x020002;
  constexpr size_t kEntryBytes = 16, kFieldBytes = 12;
  const std::string_view text(reinterpret_cast<const char*>(file.data()), file.size());
  const size_t mark = text.find(std::string_view("MPF\0", 4));
  if (mark == std::string_view::npos || mark > (size_t{1} << 20)) return {};
  const size_t base = mark + 4;  // the index counts from here
  const bool little = text.substr(base, 2) == "II";
  const auto number = [&](size_t at, size_t bytes) -> size_t {
    size_t value = 0;
    for (size_t i = 0; i < bytes && base + at + bytes <= file.size(); ++i)
      value = value << 8 | file[base + at + (little ? bytes - 1 - i : i)];
    return value;
  };
  std::vector<Part> eyes;
  const size_t directory = number(4, 4);
  for (size_t f = 0, fields = number(directory, 2); f < fields; ++f) {
    const size_t field = directory + 2 + f * kFieldBytes;
    if (number(field, 2) != kEntries) continue;
    const size_t list = number(field + 8, 4);
    const size_t bytes = std::min(number(field + 4, 4), file.size());
    for (size_t at = 0; at < bytes && eyes.size() < 2; at += kEntryBytes) {
      const size_t size = number(list + at + 4, 4), offset = number(list + at + 8, 4);
      const size_t begin = offset == 0 ? 0 : base + offset;
      if ((number(list + at, 4) & kKind) != kDisparity) continue;
      if (begin >= file.size() || size > file.size() - begin) return {};
      eyes.push_back({.bytes = file.subspan(begin, size)});
    }
    break;
  }
  const bool is_pair = eyes.size() == 2 && eyes[0].bytes.data() == file.data();
  return is_pair ? eyes : std::vector<Part>();
}

/// Returns the parts of an EXR file, or its groups of channels, that are of the views left and
/// right.
std::vector<Part> eyes_in_exr(OIIO::ImageInput& input, std::span<const uint8_t> file) {
  constexpr int kMostParts = 64, kColours = 3;
  std::optional<Part> left, right;
  for (int part = 0; part < kMostParts && input.seek_subimage(part, 0); ++part) {
    const OIIO::ImageSpec& spec = input.spec();
    const std::string view = spec.get_string_attribute("view");
    if (view == "left" && !left) left = {.bytes = file, .subimage = part, .channels = kColours};
    if (view == "right" && !right) right = {.bytes = file, .subimage = part, .channels = kColours};
    for (const auto& [name, eye, other] :
         {std::tuple("left.R", &left, &right), std::tuple("right.R", &right, &left)}) {
      const auto channel = std::ranges::find(spec.channelnames, name);
      if (part > 0 || channel == spec.channelnames.end()) continue;
      *eye = {.bytes = file,
              .channel = static_cast<int>(channel - spec.channelnames.begin()),
              .channels = kColours};
      if (!*other) *other = {.bytes = file, .channels = kColours};  // the default view has no name
    }
  }
  input.seek_subimage(0, 0);
  return left && right ? std::vector<Part>{*left, *right} : std::vector<Part>();
}

/// PictureReader decodes the picture in a file. A file for two eyes is one picture, with the left
/// eye's half on the left, if frames are wanted of it.
class PictureReader {
 public:
  /// Opens the picture and checks its header against the limits. A texture is that of one eye.
  ///
  /// Lifetime: `bytes` must outlive the reader.
  PictureReader(std::span<const uint8_t> bytes, const std::string& name, bool is_texture = false)
      : PictureReader(Part{.bytes = bytes}, name) {
    if (is_texture) return;
    std::vector<Part> eyes;
    // Other names are not looked at for two eyes: as a woven frame, such a file has one picture.
    if (lower_case(name_).ends_with(".mpo")) eyes = eyes_in_jpeg(bytes);
    if (format_ == ImageFormat::Exr) eyes = eyes_in_exr(*input_, bytes);
    if (format_ == ImageFormat::Heif && eyes_in_heif(bytes))
      eyes = {{.bytes = bytes, .subimage = kHeifLeft}, {.bytes = bytes, .subimage = kHeifRight}};
    if (eyes.empty()) return;
    part_ = eyes[0];
    if (!input_->seek_subimage(part_.subimage, 0)) fail_decoding();
    check_header();
    right_.reset(new PictureReader(eyes[1], name + " (right eye)"));
    check_picture_size(name, static_cast<uint64_t>(row_width()), static_cast<uint64_t>(height()),
                       kMaxImagePixels);
    if (right_->width() != width() || right_->height() != height() ||
        right_->channels_read() != channels_read() || right_->sample_ != sample_)
      fail("its two eyes' pictures differ in size or kind");
    if (orientation() != Orientation::Upright) fail("its two eyes' pictures lie on their sides");
  }

  [[nodiscard]] int width() const { return is_padded() ? spec().full_width : spec().width; }
  [[nodiscard]] int height() const { return is_padded() ? spec().full_height : spec().height; }
  /// Returns the width of the rows that read() gives.
  [[nodiscard]] int row_width() const { return width() * (right_ ? 2 : 1); }
  /// Leaves values that are not colours as the file stores them.
  void keep_primaries() { to_srgb_.reset(); }
  [[nodiscard]] bool has_8_bits() const { return sample_ == Sample::U8; }
  [[nodiscard]] PictureInfo info() const {
    return {.geometry = {.width = row_width(), .height = height()},
            .orientation = orientation(),
            .pixel_aspect = pixel_aspect(),
            .two_eyes = right_ != nullptr};
  }
  /// Returns the index of alpha among a band's channels, or -1.
  [[nodiscard]] int alpha_channel() const {
    return spec().alpha_channel < channels_read() ? spec().alpha_channel : -1;
  }

  /// Decodes from the top in bands. The first band comes before the caller allocates its result, so
  /// that a header with a false size costs little.
  template <class Sink>
  void read(Sink&& sink) {
    constexpr int kScanlinesPerBand = 64;
    const int rows_per_band = spec().tile_width > 0 ? spec().tile_height : kScanlinesPerBand;
    const size_t row = static_cast<size_t>(width()) * pixel_bytes();
    const auto most = static_cast<size_t>(std::min(rows_per_band, height()));
    std::vector<uint8_t> buffer(row * most), left(right_ ? row * most : 0), right(left.size());
    buffer.resize(right_ ? 2 * buffer.size() : buffer.size());
    for (int y = 0; y < height(); y += rows_per_band) {
      const int rows = std::min(rows_per_band, height() - y);
      decode(y, rows, right_ ? left.data() : buffer.data());
      if (right_) right_->decode(y, rows, right.data());
      for (size_t r = 0; right_ && r < static_cast<size_t>(rows); ++r) {
        std::copy_n(left.data() + r * row, row, buffer.data() + 2 * r * row);
        std::copy_n(right.data() + r * row, row, buffer.data() + (2 * r + 1) * row);
      }
      sink(Band{y, rows, channels_read(), sample_, buffer.data()});
    }
  }

  [[noreturn]] void fail(const std::string& cause) const {
    throw input_error("{}: {}", name_, cause).remedy(kPictureRemedy);
  }

 private:
  PictureReader(const Part& part, std::string name)
      : name_(std::move(name)), part_(part), memory_(part.bytes.data(), part.bytes.size()) {
    set_up_libraries();
    const std::span<const uint8_t> bytes = part.bytes;
    format_ = detect_format(bytes, name_);
    if (format_ == ImageFormat::Unknown) {
      const std::string extension = std::filesystem::path(lower_case(name_)).extension().string();
      const auto [is, remedy] =
          unknown_kind({reinterpret_cast<const char*>(bytes.data()), bytes.size()}, extension);
      throw input_error("{}: {}", name_, is).remedy(std::string(remedy));
    }
    if (!reaches_end_mark(format_, bytes)) fail("truncated");
    if (!header_fits(format_, bytes)) fail("its header states more bytes than the file has");
    open();
    check_header();
  }

  [[nodiscard]] const OIIO::ImageSpec& spec() const { return input_->spec(); }
  [[nodiscard]] int channels_read() const {
    return std::min(spec().nchannels - part_.channel, part_.channels);
  }
  [[nodiscard]] size_t pixel_bytes() const {
    return static_cast<size_t>(channels_read()) * sample_type().size();
  }
  /// Returns true if the pixels that an EXR file stores are not those of its display window.
  [[nodiscard]] bool is_padded() const {
    const OIIO::ImageSpec& s = spec();
    return format_ == ImageFormat::Exr && (s.x != s.full_x || s.y != s.full_y ||
                                           s.width != s.full_width || s.height != s.full_height);
  }
  [[nodiscard]] OIIO::TypeDesc sample_type() const {
    if (sample_ == Sample::U8) return OIIO::TypeDesc::UINT8;
    return sample_ == Sample::U16 ? OIIO::TypeDesc::UINT16 : OIIO::TypeDesc::FLOAT;
  }

  /// Returns the orientation; Upright if the tag is missing or invalid.
  [[nodiscard]] Orientation orientation() const {
    // The reader of Targa has already applied the orientation.
    if (format_ == ImageFormat::Targa) return Orientation::Upright;
    const int tag = spec().get_int_attribute("Orientation", 1);
    return tag >= 1 && tag <= 8 ? static_cast<Orientation>(tag) : Orientation::Upright;
  }

  /// Returns the pixel aspect, from pixels per length in formats that state them. Returns 1 for
  /// implausible tags.
  [[nodiscard]] double pixel_aspect() const {
    const float across = spec().get_float_attribute("XResolution", 0.0f);
    const float down = spec().get_float_attribute("YResolution", 0.0f);
    const double aspect =
        across > 0.0f && down > 0.0f && format_ != ImageFormat::Exr
            ? static_cast<double>(down) / static_cast<double>(across)
            : static_cast<double>(spec().get_float_attribute("PixelAspectRatio", 1.0f));
    return plausible_pixel_aspect(aspect);
  }

  void open() {
    OIIO::ImageSpec config;
    config.attribute("oiio:UnassociatedAlpha", 1);  // never multiply alpha into the code values
    input_ = format_ == ImageFormat::Heif ? std::make_unique<HeifReader>(part_.bytes)
                                          : OIIO::ImageInput::create(plugin_name(format_));
    if (!input_) fail(fmt::format("this OpenImageIO cannot read {}", plugin_name(format_)));
    input_->threads(1);
    OIIO::ImageSpec ignored;
    input_->set_ioproxy(&memory_);
    if (!input_->open(name_, ignored, config)) fail_decoding();
    if (!input_->seek_subimage(part_.subimage, 0)) fail_decoding();
    memory_.forget();
  }

  void check_header() {
    const OIIO::ImageSpec& s = spec();
    if (s.width < 1 || s.height < 1 || s.depth > 1 || s.nchannels < 1 || s.deep)
      fail("not a two-dimensional picture with pixels");
    check_picture_size(name_, static_cast<uint64_t>(s.width), static_cast<uint64_t>(s.height),
                       kMaxImagePixels);
    check_picture_size(name_, static_cast<uint64_t>(std::max(width(), 0)),
                       static_cast<uint64_t>(std::max(height(), 0)), kMaxImagePixels);
    if (s.tile_width > kMaxImageSide || s.tile_height > kMaxImageSide ||
        s.tile_bytes() > (size_t{1} << 28))
      fail("tile size out of range");
    const auto sample = sample_of(s);
    if (!sample) fail("its samples are neither integers of 8 or 16 bits nor floats");
    sample_ = *sample;
    const bool linear = format_ == ImageFormat::Exr && sample_ == Sample::F32;
    to_srgb_ = linear && channels_read() >= 3 ? to_srgb_primaries(s) : std::nullopt;
  }

  static std::optional<Sample> sample_of(const OIIO::ImageSpec& s) {
    const auto is_float = [](OIIO::TypeDesc type) {
      return type == OIIO::TypeDesc::HALF || type == OIIO::TypeDesc::FLOAT ||
             type == OIIO::TypeDesc::DOUBLE;
    };
    if (is_float(s.format)) return Sample::F32;
    if (!s.channelformats.empty()) return std::nullopt;
    if (s.format == OIIO::TypeDesc::UINT8) return Sample::U8;
    if (s.format == OIIO::TypeDesc::UINT16) return Sample::U16;
    return std::nullopt;
  }

  /// Decodes rows of the display window; what the file does not store of it is black.
  void decode(int y, int rows, uint8_t* out) {
    const OIIO::ImageSpec& s = spec();
    // A compressed plane can only be decoded from its beginning.
    const bool is_planar = s.get_string_attribute("planarconfig") == "separate";
    if (!is_padded() && !is_planar) return decode_stored(y, rows, out);
    const int x0 = is_padded() ? s.full_x : s.x, y0 = is_padded() ? s.full_y : s.y;
    const size_t pixel = pixel_bytes(), row_bytes = static_cast<size_t>(width()) * pixel;
    if (stored_.empty()) {
      stored_.resize(static_cast<size_t>(s.width) * static_cast<size_t>(s.height) * pixel);
      decode_stored(0, s.height, stored_.data());
    }
    std::fill_n(out, static_cast<size_t>(rows) * row_bytes, uint8_t{0});
    const int left = std::max(s.x, x0), right = std::min(s.x + s.width, x0 + width());
    for (int row = 0; row < rows && left < right; ++row, out += row_bytes) {
      const int stored = y + row + y0 - s.y;
      if (stored < 0 || stored >= s.height) continue;
      const size_t from = static_cast<size_t>(stored) * static_cast<size_t>(s.width) +
                          static_cast<size_t>(left - s.x);
      std::copy_n(stored_.data() + from * pixel, static_cast<size_t>(right - left) * pixel,
                  out + static_cast<size_t>(left - x0) * pixel);
    }
  }

  void decode_stored(int y, int rows, uint8_t* out) {
    const OIIO::ImageSpec& s = spec();
    const int y0 = s.y + y, first = part_.channel, last = first + channels_read();
    const bool done = s.tile_width > 0
                          ? input_->read_tiles(part_.subimage, 0, s.x, s.x + s.width, y0, y0 + rows,
                                               s.z, s.z + 1, first, last, sample_type(), out)
                          : input_->read_scanlines(part_.subimage, 0, y0, y0 + rows, s.z, first,
                                                   last, sample_type(), out);
    if (!done) fail_decoding();
    if (to_srgb_) convert_primaries(reinterpret_cast<float*>(out), rows);
    if (format_ == ImageFormat::Tiff && memory_.ran_out()) fail("truncated");
    if (format_ == ImageFormat::Jpeg && warns_of_damage()) fail_decoding();
  }

  void convert_primaries(float* samples, int rows) const {
    for (int64_t n = int64_t{rows} * spec().width; n > 0; --n, samples += channels_read()) {
      const Triple colour = {samples[0], samples[1], samples[2]};
      for (size_t c = 0; c < 3; ++c) samples[c] = static_cast<float>(dot((*to_srgb_)[c], colour));
    }
  }

  /// Returns true if libjpeg filled in missing or damaged data. OpenImageIO counts that as success
  /// and keeps the first warning. Bytes between the data and the next marker change no pixel.
  [[nodiscard]] bool warns_of_damage() const {
    if (!input_->has_error()) return false;
    const std::string warning = input_->geterror(false);
    const auto says = [&](const char* words) { return warning.find(words) != std::string::npos; };
    return says("Premature end") || (says("Corrupt JPEG data") && !says("extraneous bytes"));
  }

  [[noreturn]] void fail_decoding() const {
    std::string cause = input_->geterror();
    std::replace(cause.begin(), cause.end(), '\n', ' ');
    while (!cause.empty() && cause.back() == ' ') cause.pop_back();
    if (cause.empty()) cause = "no reason given";
    fail("truncated or damaged: " + cause);
  }

  std::string name_;
  Part part_;
  PictureMemory memory_;
  ImageFormat format_ = ImageFormat::Unknown;
  Sample sample_ = Sample::U8;
  std::optional<std::array<Triple, 3>> to_srgb_;  ///< matrix of the colours, if others than sRGB's
  std::vector<uint8_t> stored_;           ///< all stored pixels, if the picture is padded or planar
  std::unique_ptr<PictureReader> right_;  ///< the right eye's picture
  std::unique_ptr<OIIO::ImageInput>
      input_;  // must follow memory_, which it reads from until destroyed
};

/// Converts each pixel's samples to `per_pixel` values: three of `light`, and perhaps `coverage`.
template <class Source, class Target, class Light, class Coverage>
void convert_band(const Band& band, int width, int alpha, Target* out, int per_pixel, Light light,
                  Coverage coverage, Target opaque) {
  const int r = band.colour_channel(0), g = band.colour_channel(1), b = band.colour_channel(2);
  const auto* in = reinterpret_cast<const Source*>(band.data);
  const size_t pixels = static_cast<size_t>(width) * static_cast<size_t>(band.rows);
  for (size_t p = 0; p < pixels; ++p, in += band.channels, out += per_pixel) {
    out[0] = light(in[r]);
    out[1] = light(in[g]);
    out[2] = light(in[b]);
    if (per_pixel > 3) out[3] = alpha >= 0 ? coverage(in[alpha]) : opaque;
  }
}

/// Converts to bytes: codes of three channels, or of four if they have 8 bits.
void bytes_from_band(const Band& band, int width, int alpha, int per_pixel, uint8_t* out) {
  const auto convert = [&]<class Source>(Source, auto code) {
    convert_band<Source>(band, width, alpha, out, per_pixel, code, code, uint8_t{255});
  };
  switch (band.sample) {
    case Sample::U8:
      return convert(uint8_t{}, [](uint8_t v) { return v; });
    case Sample::U16:
      return convert(uint16_t{}, code_from_16_bits);
    case Sample::F32:
      return convert(float{}, [](float v) { return code_from_linear(v); });
  }
}

/// Converts samples of more than 8 bits to four floats.
void floats_from_band(const Band& band, int width, int alpha, PictureValues values, float* out) {
  const auto convert = [&]<class Source>(Source, auto light, auto coverage) {
    convert_band<Source>(band, width, alpha, out, 4, light, coverage, 1.0f);
  };
  const auto same = [](float v) { return v; };
  if (band.sample == Sample::F32) return convert(float{}, same, same);
  const bool data = values == PictureValues::Data;
  convert(uint16_t{}, data ? fraction_of_16_bits : linear_from_16_bits, fraction_of_16_bits);
}

// --- encoding

OIIO::ImageSpec output_spec(const FrameGeometry& geometry, ImageFormat format) {
  OIIO::ImageSpec spec(geometry.width, geometry.height, 3,
                       format == ImageFormat::Exr ? OIIO::TypeDesc::HALF : OIIO::TypeDesc::UINT8);
  spec.attribute("oiio:dither", 0);
  if (format == ImageFormat::Tiff) spec.attribute("compression", "lzw");
  if (format == ImageFormat::Exr) spec.attribute("compression", "zip");
  // The same pixels must give the same bytes, but these formats would record the time of day.
  if (format == ImageFormat::Tiff || format == ImageFormat::Exr)
    spec.attribute("DateTime", "1970:01:01 00:00:00");
  return spec;
}

std::vector<float> light_of(std::span<const uint8_t> codes) {
  const auto& table = linear_of_codes();
  std::vector<float> light(codes.size());
  std::transform(codes.begin(), codes.end(), light.begin(),
                 [&](uint8_t code) { return static_cast<float>(table[code]); });
  return light;
}

bool write_pixels(OIIO::ImageOutput& output, const FrameView& frame, ImageFormat format) {
  if (format != ImageFormat::Exr)
    return output.write_image(OIIO::TypeDesc::UINT8, frame.bytes.data());
  return output.write_image(OIIO::TypeDesc::FLOAT, light_of(frame.bytes).data());
}

// --- the codec

class OiioCodec final : public PictureCodec {
 public:
  PictureInfo probe(std::span<const uint8_t> bytes, const std::string& name) const override {
    return PictureReader(bytes, name).info();
  }
  void decode(std::span<const uint8_t> bytes, const std::string& name, PictureValues values,
              PictureSink& sink) const override {
    const bool codes = values == PictureValues::Codes;
    PictureReader reader(bytes, name, !codes);
    if (values == PictureValues::Data) reader.keep_primaries();
    PictureInfo info = reader.info();
    if (!codes) info.pixel_bytes = reader.has_8_bits() ? 4 : 4 * sizeof(float);
    sink.accept(info);
    const int width = reader.row_width();
    const size_t row = info.pixel_bytes * static_cast<size_t>(width);
    reader.read([&](const Band& band) {
      for (int done = 0; done < band.rows;) {
        const std::span<uint8_t> out = sink.rows(band.y + done, band.rows - done);
        const Band part = band.part(done, static_cast<int>(out.size() / row), width);
        if (codes || reader.has_8_bits())
          bytes_from_band(part, width, reader.alpha_channel(), codes ? 3 : 4, out.data());
        else
          floats_from_band(part, width, reader.alpha_channel(), values,
                           reinterpret_cast<float*>(out.data()));
        done += part.rows;
      }
    });
  }
  std::vector<uint8_t> encode(const FrameView& frame, ImageFormat format,
                              const std::string& name) const override {
    set_up_libraries();
    std::vector<uint8_t> bytes;
    OIIO::Filesystem::IOVecOutput memory(bytes);
    const auto fail = [&](const std::string& cause) {
      throw failed_error("{}: cannot encode: {}", name, cause);
    };
    const std::unique_ptr<OIIO::ImageOutput> output =
        OIIO::ImageOutput::create(plugin_name(format));
    if (!output) fail(fmt::format("this OpenImageIO cannot write {}", plugin_name(format)));
    output->threads(1);
    output->set_ioproxy(&memory);
    const bool done = output->open(name, output_spec(frame.geometry, format)) &&
                      write_pixels(*output, frame, format) && output->close();
    if (!done) fail(output->geterror());
    return bytes;
  }
};

}  // namespace
}  // namespace lenticule::frames::pictures

extern "C" [[gnu::visibility("default")]] const lenticule::frames::PictureCodec*
lenticule_picture_codec(const char* version) noexcept {
  static const lenticule::frames::pictures::OiioCodec codec;
  return version == std::string_view(LENTICULE_VERSION) ? &codec : nullptr;
}
