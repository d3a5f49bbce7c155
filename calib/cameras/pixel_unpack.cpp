// SPDX-License-Identifier: Apache-2.0
#include "calib/cameras/pixel_unpack.h"

#include <fmt/format.h>
#include <linux/videodev2.h>
#include <turbojpeg.h>

#include <algorithm>
#include <cmath>

#include "base/error.h"
#include "frames/srgb.h"

namespace lenticule::calib {
namespace {

struct LumaWeights {
  double red;
  double blue;
};

LumaWeights luma_weights(uint32_t encoding) {
  switch (encoding) {
    case V4L2_YCBCR_ENC_709:
    case V4L2_YCBCR_ENC_XV709:
      return {.red = 0.2126, .blue = 0.0722};
    case V4L2_YCBCR_ENC_BT2020:
    case V4L2_YCBCR_ENC_BT2020_CONST_LUM:
      return {.red = 0.2627, .blue = 0.0593};
    case V4L2_YCBCR_ENC_SMPTE240M:
      return {.red = 0.212, .blue = 0.087};
    default:
      return {.red = 0.299, .blue = 0.114};
  }
}

/// Evaluates a curve with a linear part near black and a power above, as in BT.709 and SMPTE 240M.
double camera_curve(double encoded, double slope, double knee, double lift) {
  if (encoded < knee) return encoded / slope;
  return std::pow((encoded + lift) / (1.0 + lift), 1.0 / 0.45);
}

/// Evaluates SMPTE ST 2084.
double perceptual_quantizer(double encoded) {
  constexpr double kM1 = 2610.0 / 16384.0;
  constexpr double kM2 = 2523.0 / 4096.0 * 128.0;
  constexpr double kC1 = 3424.0 / 4096.0;
  constexpr double kC2 = 2413.0 / 4096.0 * 32.0;
  constexpr double kC3 = 2392.0 / 4096.0 * 32.0;
  const double root = std::pow(encoded, 1.0 / kM2);
  return std::pow(std::max(root - kC1, 0.0) / (kC2 - kC3 * root), 1.0 / kM1);
}

/// Returns a number that V4L2 defines, or 0.
uint32_t known(uint32_t number, uint32_t largest) {
  return number <= largest ? number : 0;
}

}  // namespace

ColourCoding resolved(ColourCoding coding, Samples samples) {
  coding.colorspace = known(coding.colorspace, V4L2_COLORSPACE_DCI_P3);
  coding.ycbcr_enc = known(coding.ycbcr_enc, V4L2_YCBCR_ENC_SMPTE240M);
  coding.quantization = known(coding.quantization, V4L2_QUANTIZATION_LIM_RANGE);
  coding.xfer_func = known(coding.xfer_func, V4L2_XFER_FUNC_SMPTE2084);
  // A webcam is neither SDTV nor HDTV.
  if (coding.colorspace == V4L2_COLORSPACE_DEFAULT)
    coding.colorspace = V4L2_MAP_COLORSPACE_DEFAULT(false, false);
  const uint32_t space = coding.colorspace;
  if (coding.ycbcr_enc == V4L2_YCBCR_ENC_DEFAULT)
    coding.ycbcr_enc = V4L2_MAP_YCBCR_ENC_DEFAULT(space);
  if (coding.xfer_func == V4L2_XFER_FUNC_DEFAULT)
    coding.xfer_func = V4L2_MAP_XFER_FUNC_DEFAULT(space);
  if (coding.quantization == V4L2_QUANTIZATION_DEFAULT) {
    // Raw sensors have no headroom, although V4L2's rule assigns some to their Y'CbCr.
    const bool full = samples != Samples::Ycbcr || space == V4L2_COLORSPACE_RAW;
    coding.quantization = V4L2_MAP_QUANTIZATION_DEFAULT(full, space, coding.ycbcr_enc);
  }
  return coding;
}

CodeScale code_scale(const ColourCoding& resolved_coding, int bits) {
  const double largest = std::ldexp(1.0, bits) - 1.0;
  const double step = std::ldexp(1.0, bits - 8);  // limited range is defined for 8 bits
  if (resolved_coding.quantization == V4L2_QUANTIZATION_FULL_RANGE)
    return {.black = 0.0,
            .per_code = 1.0 / largest,
            .chroma_middle = 128.0 * step,
            .chroma_per_code = 1.0 / largest};
  return {.black = 16.0 * step,
          .per_code = 1.0 / (219.0 * step),
          .chroma_middle = 128.0 * step,
          .chroma_per_code = 1.0 / (224.0 * step)};
}

YcbcrMatrix ycbcr_matrix(const ColourCoding& resolved_coding) {
  const auto [red, blue] = luma_weights(resolved_coding.ycbcr_enc);
  const double green = 1.0 - red - blue;
  return {.red_cr = 2.0 * (1.0 - red),
          .green_cb = -2.0 * blue * (1.0 - blue) / green,
          .green_cr = -2.0 * red * (1.0 - red) / green,
          .blue_cb = 2.0 * (1.0 - blue)};
}

double linear_by_formula(uint32_t resolved_xfer_func, double encoded) {
  switch (resolved_xfer_func) {
    case V4L2_XFER_FUNC_NONE:
      return encoded;
    case V4L2_XFER_FUNC_SRGB:
      return frames::linear_from_srgb(encoded);
    case V4L2_XFER_FUNC_OPRGB:
      return std::pow(encoded, 563.0 / 256.0);
    case V4L2_XFER_FUNC_SMPTE240M:
      return camera_curve(encoded, 4.0, 0.0913, 0.1115);
    case V4L2_XFER_FUNC_DCI_P3:
      return std::pow(encoded, 2.6);
    case V4L2_XFER_FUNC_SMPTE2084:
      return perceptual_quantizer(encoded);
    default:
      return camera_curve(encoded, 4.5, 0.081, 0.099);
  }
}

TransferCurve::TransferCurve(uint32_t resolved_xfer_func) {
  table_.reserve(kSteps + 2);
  for (int i = 0; i <= kSteps; ++i)
    table_.push_back(static_cast<float>(linear_by_formula(resolved_xfer_func, i * 1.0 / kSteps)));
  table_.push_back(table_.back());
}

namespace {

constexpr std::array kLayouts{
    PixelLayout{.fourcc = V4L2_PIX_FMT_GREY},
    PixelLayout{.fourcc = V4L2_PIX_FMT_Y16, .packing = Packing::Grey16, .bits = 16},
    PixelLayout{.fourcc = V4L2_PIX_FMT_Y12, .packing = Packing::Grey16, .bits = 12},
    PixelLayout{.fourcc = V4L2_PIX_FMT_Y10, .packing = Packing::Grey16, .bits = 10},
    PixelLayout{.fourcc = V4L2_PIX_FMT_SRGGB8, .packing = Packing::Bayer8},
    PixelLayout{.fourcc = V4L2_PIX_FMT_SGRBG8, .packing = Packing::Bayer8, .red_column = 1},
    PixelLayout{
        .fourcc = V4L2_PIX_FMT_SBGGR8, .packing = Packing::Bayer8, .red_column = 1, .red_row = 1},
    PixelLayout{.fourcc = V4L2_PIX_FMT_SGBRG8, .packing = Packing::Bayer8, .red_row = 1},
    PixelLayout{.fourcc = V4L2_PIX_FMT_YUYV, .packing = Packing::Yuv422},
    PixelLayout{
        .fourcc = V4L2_PIX_FMT_UYVY, .packing = Packing::Yuv422, .luma_byte = 1, .chroma_byte = 0},
    PixelLayout{.fourcc = V4L2_PIX_FMT_NV12, .packing = Packing::Nv12},
    PixelLayout{.fourcc = V4L2_PIX_FMT_RGB24, .packing = Packing::Rgb},
    PixelLayout{.fourcc = V4L2_PIX_FMT_BGR24, .packing = Packing::Rgb, .red_byte = 2},
    PixelLayout{.fourcc = V4L2_PIX_FMT_MJPEG, .packing = Packing::Jpeg},
    PixelLayout{.fourcc = V4L2_PIX_FMT_JPEG, .packing = Packing::Jpeg},
};

size_t half_up(int count) {
  return (static_cast<size_t>(count) + 1) / 2;
}

}  // namespace

Samples PixelLayout::samples() const {
  if (channels() == 1) return Samples::Luma;
  return packing == Packing::Yuv422 || packing == Packing::Nv12 ? Samples::Ycbcr : Samples::Rgb;
}

std::span<const PixelLayout> supported_layouts() {
  return kLayouts;
}

const PixelLayout* layout_of(uint32_t fourcc) {
  for (const PixelLayout& layout : kLayouts)
    if (layout.fourcc == fourcc) return &layout;
  return nullptr;
}

const PixelLayout* layout_named(std::string_view name) {
  for (const PixelLayout& layout : kLayouts)
    if (fourcc_name(layout.fourcc) == name) return &layout;
  return nullptr;
}

std::string fourcc_name(uint32_t fourcc) {
  std::string name;
  for (int shift = 0; shift < 32; shift += 8) name += static_cast<char>(fourcc >> shift & 0xFF);
  const bool printable =
      std::all_of(name.begin(), name.end(), [](char c) { return c >= ' ' && c <= '~'; });
  if (!printable || name == "    ") return fmt::format("0x{:08x}", fourcc);
  return name.substr(0, name.find_last_not_of(' ') + 1);
}

size_t row_bytes(const PixelLayout& layout, int width) {
  const auto columns = static_cast<size_t>(width);
  switch (layout.packing) {
    case Packing::Grey8:
    case Packing::Bayer8:
      return columns;
    case Packing::Grey16:
      return columns * 2;
    case Packing::Yuv422:
      return half_up(width) * 4;
    case Packing::Nv12:
      return half_up(width) * 2;
    case Packing::Rgb:
      return columns * 3;
    case Packing::Jpeg:
      break;
  }
  return 0;
}

size_t picture_bytes(const PixelLayout& layout, int width, int height, size_t bytes_per_line) {
  if (layout.packing == Packing::Jpeg) return 0;
  size_t rows = static_cast<size_t>(height);
  if (layout.packing == Packing::Nv12) rows += half_up(height);
  return (rows - 1) * bytes_per_line + row_bytes(layout, width);
}

namespace {

/// Returns true for a harmless warning. The library keeps its first warning; if that warning is
/// about bytes before the end marker, the picture was complete.
bool is_harmless(tjhandle handle) {
  if (tjGetErrorCode(handle) != TJERR_WARNING) return false;
  return std::string_view(tjGetErrorStr2(handle)).ends_with("extraneous bytes before marker 0xd9");
}

// Interpolates the colours of a sensor with a Bayer mosaic of filters.

/// BayerOrder is the position of the first red pixel: column and row, 0 or 1 each.
struct BayerOrder {
  int red_column = 0;
  int red_row = 0;
};

/// Returns the mirrored index beyond an edge: that inner neighbour has the filter of the missing
/// one.
int mirrored(int index, int count) {
  if (index < 0) return 1;
  return index < count ? index : count - 2;
}

/// Surroundings holds the neighbourhood of a mosaic pixel.
struct Surroundings {
  const float* above;
  const float* here;
  const float* below;
  int left;
  int x;
  int right;

  [[nodiscard]] float beside() const { return 0.5F * (here[left] + here[right]); }
  [[nodiscard]] float upright() const { return 0.5F * (above[x] + below[x]); }
  [[nodiscard]] float cross() const { return 0.5F * (beside() + upright()); }
  [[nodiscard]] float corners() const {
    return 0.25F * (above[left] + above[right] + below[left] + below[right]);
  }
};

void set_pixel(const Surroundings& at, bool red_column, bool red_row, float* rgb) {
  if (red_column == red_row) {  // pixel under a red or blue filter
    rgb[0] = red_row ? at.here[at.x] : at.corners();
    rgb[1] = at.cross();
    rgb[2] = red_row ? at.corners() : at.here[at.x];
    return;
  }
  rgb[0] = red_row ? at.beside() : at.upright();
  rgb[1] = at.here[at.x];
  rgb[2] = red_row ? at.upright() : at.beside();
}

/// Interpolates bilinearly: a colour without a filter on a pixel is the mean of its nearest
/// neighbours with that filter. `mosaic` holds width * height values of linear light, `rgb` three
/// times as many. Both sides are at least 2.
///
/// Thread safety: any thread.
void interpolate_bayer(std::span<const float> mosaic, int width, int height, BayerOrder order,
                       std::span<float> rgb) {
  const size_t pixels = static_cast<size_t>(width) * static_cast<size_t>(height);
  LENTICULE_CHECK(width >= 2 && height >= 2 && mosaic.size() >= pixels && rgb.size() >= 3 * pixels);
  float* out = rgb.data();
  for (int y = 0; y < height; ++y) {
    const float* const above = &mosaic[static_cast<size_t>(mirrored(y - 1, height)) * width];
    const float* const here = &mosaic[static_cast<size_t>(y) * width];
    const float* const below = &mosaic[static_cast<size_t>(mirrored(y + 1, height)) * width];
    for (int x = 0; x < width; ++x, out += 3) {
      const Surroundings at{above, here, below, mirrored(x - 1, width), x, mirrored(x + 1, width)};
      set_pixel(at, (x & 1) == order.red_column, (y & 1) == order.red_row, out);
    }
  }
}

constexpr int kMaxSide = 16384;
constexpr int64_t kMaxPixels = int64_t{1} << 26;
constexpr size_t kMaxBytesPerLine = size_t{1} << 20;

[[noreturn]] void refuse(const std::string& camera, const std::string& cause) {
  throw Error(ErrorKind::Device, camera + ": " + cause,
              "choose another format or size ('lenticule calibrate camera --list')");
}

PixelLayout require_layout(uint32_t fourcc, const std::string& camera) {
  const PixelLayout* const layout = layout_of(fourcc);
  if (layout == nullptr) refuse(camera, "pixel format " + fourcc_name(fourcc) + " is not known");
  return *layout;
}

RawFormat checked_format(RawFormat format, const PixelLayout& layout, const std::string& camera) {
  const int smallest = layout.packing == Packing::Bayer8 ? 2 : 1;
  if (format.width < smallest || format.height < smallest || format.width > kMaxSide ||
      format.height > kMaxSide || int64_t{format.width} * format.height > kMaxPixels)
    refuse(camera,
           fmt::format("pictures of {}x{} pixels; expected {}x{} to {}x{}, at most {} pixels",
                       format.width, format.height, smallest, smallest, kMaxSide, kMaxSide,
                       kMaxPixels));
  const size_t packed = row_bytes(layout, format.width);
  if (format.bytes_per_line == 0 || layout.packing == Packing::Jpeg) format.bytes_per_line = packed;
  if (format.bytes_per_line < packed || format.bytes_per_line > kMaxBytesPerLine)
    refuse(camera, fmt::format("rows of {} bytes cannot hold {} pixels of {}",
                               format.bytes_per_line, format.width, fourcc_name(format.fourcc)));
  format.coding = resolved(format.coding, layout.samples());
  return format;
}

/// Returns the code scale. libjpeg-turbo's R'G'B' is full range, regardless of the driver's values.
CodeScale scale_of(const RawFormat& format, const PixelLayout& layout) {
  if (layout.packing == Packing::Jpeg) return {.black = 0.0, .per_code = 1.0 / 255.0};
  return code_scale(format.coding, layout.bits);
}

}  // namespace

PixelUnpacker::PixelUnpacker(const RawFormat& format, const std::string& camera)
    : layout_(require_layout(format.fourcc, camera)),
      format_(checked_format(format, layout_, camera)),
      bytes_needed_(picture_bytes(layout_, format_.width, format_.height, format_.bytes_per_line)),
      curve_(format_.coding.xfer_func),
      matrix_(ycbcr_matrix(format_.coding)) {
  const CodeScale scale = scale_of(format_, layout_);
  wide_black_ = static_cast<float>(scale.black);
  wide_per_code_ = static_cast<float>(scale.per_code);
  for (size_t code = 0; code < 256; ++code) {
    const auto value = static_cast<double>(code);
    encoded_of_luma_[code] = static_cast<float>((value - scale.black) * scale.per_code);
    const double held = std::clamp((value - scale.black) * scale.per_code, 0.0, 1.0);
    light_of_code_[code] = static_cast<float>(linear_by_formula(format_.coding.xfer_func, held));
    chroma_of_code_[code] =
        static_cast<float>((value - scale.chroma_middle) * scale.chroma_per_code);
  }
  if (layout_.packing != Packing::Jpeg) return;
  jpeg_.reset(tjInitDecompress());
  if (!jpeg_) throw Error(ErrorKind::Failed, "jpeg decoder: out of memory");
}

bool PixelUnpacker::unpack(std::span<const uint8_t> bytes, CameraPicture& out) {
  if (bytes.size() < bytes_needed_) return false;
  out.width = format_.width;
  out.height = format_.height;
  out.channels = channels();
  out.light.resize(static_cast<size_t>(out.width) * static_cast<size_t>(out.height) *
                   static_cast<size_t>(out.channels));
  switch (layout_.packing) {
    case Packing::Grey8:
      unpack_grey8(bytes, out.light);
      return true;
    case Packing::Grey16:
      unpack_grey16(bytes, out.light);
      return true;
    case Packing::Bayer8:
      unpack_bayer(bytes, out.light);
      return true;
    case Packing::Yuv422:
      unpack_yuv422(bytes, out.light);
      return true;
    case Packing::Nv12:
      unpack_nv12(bytes, out.light);
      return true;
    case Packing::Rgb:
      unpack_rgb(bytes, out.light);
      return true;
    case Packing::Jpeg:
      break;
  }
  return unpack_jpeg(bytes, out.light);
}

const uint8_t* PixelUnpacker::row(std::span<const uint8_t> bytes, int y) const {
  return bytes.data() + static_cast<size_t>(y) * format_.bytes_per_line;
}

void PixelUnpacker::unpack_grey8(std::span<const uint8_t> bytes, std::span<float> light) const {
  float* out = light.data();
  for (int y = 0; y < format_.height; ++y) {
    const uint8_t* const codes = row(bytes, y);
    for (int x = 0; x < format_.width; ++x) *out++ = light_of_code_[codes[x]];
  }
}

void PixelUnpacker::unpack_grey16(std::span<const uint8_t> bytes, std::span<float> light) const {
  float* out = light.data();
  for (int y = 0; y < format_.height; ++y) {
    const uint8_t* codes = row(bytes, y);
    for (int x = 0; x < format_.width; ++x, codes += 2) {
      const auto code = static_cast<float>(codes[0] | codes[1] << 8);
      *out++ = curve_((code - wide_black_) * wide_per_code_);
    }
  }
}

void PixelUnpacker::unpack_bayer(std::span<const uint8_t> bytes, std::span<float> light) {
  mosaic_.resize(static_cast<size_t>(format_.width) * static_cast<size_t>(format_.height));
  unpack_grey8(bytes, mosaic_);
  interpolate_bayer(mosaic_, format_.width, format_.height,
                    {.red_column = layout_.red_column, .red_row = layout_.red_row}, light);
}

void PixelUnpacker::set_ycbcr(uint8_t luma, uint8_t cb, uint8_t cr, float* rgb) const {
  const float y = encoded_of_luma_[luma];
  const float blue = chroma_of_code_[cb];
  const float red = chroma_of_code_[cr];
  rgb[0] = curve_(y + static_cast<float>(matrix_.red_cr) * red);
  rgb[1] = curve_(y + static_cast<float>(matrix_.green_cb) * blue +
                  static_cast<float>(matrix_.green_cr) * red);
  rgb[2] = curve_(y + static_cast<float>(matrix_.blue_cb) * blue);
}

void PixelUnpacker::unpack_yuv422(std::span<const uint8_t> bytes, std::span<float> light) const {
  float* out = light.data();
  for (int y = 0; y < format_.height; ++y) {
    const uint8_t* const codes = row(bytes, y);
    for (int x = 0; x < format_.width; ++x, out += 3) {
      const uint8_t* const pair = codes + static_cast<ptrdiff_t>(x / 2) * 4;
      const uint8_t luma = pair[layout_.luma_byte + 2 * (x & 1)];
      set_ycbcr(luma, pair[layout_.chroma_byte], pair[layout_.chroma_byte + 2], out);
    }
  }
}

void PixelUnpacker::unpack_nv12(std::span<const uint8_t> bytes, std::span<float> light) const {
  float* out = light.data();
  for (int y = 0; y < format_.height; ++y) {
    const uint8_t* const luma = row(bytes, y);
    const uint8_t* const chroma = row(bytes, format_.height + y / 2);
    for (int x = 0; x < format_.width; ++x, out += 3) {
      const uint8_t* const pair = chroma + static_cast<ptrdiff_t>(x / 2) * 2;
      set_ycbcr(luma[x], pair[0], pair[1], out);
    }
  }
}

void PixelUnpacker::unpack_rgb(std::span<const uint8_t> bytes, std::span<float> light) const {
  float* out = light.data();
  for (int y = 0; y < format_.height; ++y) {
    const uint8_t* codes = row(bytes, y);
    for (int x = 0; x < format_.width; ++x, codes += 3, out += 3) {
      out[0] = light_of_code_[codes[layout_.red_byte]];
      out[1] = light_of_code_[codes[1]];
      out[2] = light_of_code_[codes[2 - layout_.red_byte]];
    }
  }
}

void PixelUnpacker::CloseJpeg::operator()(void* handle) const noexcept {
  tjDestroy(handle);
}

bool PixelUnpacker::unpack_jpeg(std::span<const uint8_t> bytes, std::span<float> light) {
  int width = 0, height = 0, subsampling = 0, colorspace = 0;
  if (bytes.empty() || tjDecompressHeader3(jpeg_.get(), bytes.data(), bytes.size(), &width, &height,
                                           &subsampling, &colorspace) != 0)
    return false;
  const bool has_rgb =
      colorspace == TJCS_YCbCr || colorspace == TJCS_GRAY || colorspace == TJCS_RGB;
  if (width != format_.width || height != format_.height || !has_rgb) return false;
  rgb_.resize(light.size());
  const int failed = tjDecompress2(jpeg_.get(), bytes.data(), bytes.size(), rgb_.data(), width, 0,
                                   height, TJPF_RGB, TJFLAG_LIMITSCANS | TJFLAG_ACCURATEDCT);
  if (failed != 0 && !is_harmless(jpeg_.get())) return false;
  std::ranges::transform(rgb_, light.begin(),
                         [this](uint8_t code) { return light_of_code_[code]; });
  return true;
}

}  // namespace lenticule::calib
