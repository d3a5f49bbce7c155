// SPDX-License-Identifier: Apache-2.0
#include "apps/lenticule-video/pixel_convert.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstring>

#include "base/error.h"

namespace lenticule::video {
namespace {

/// Sums stay below 2^62 (values of +-2^9.5 codes), and a coefficient's error of half a unit times
/// the largest value, 2^22, is below 2^-30 codes.
constexpr int kFraction = 52;
constexpr int64_t kHalf = int64_t{1} << (kFraction - 1);

int64_t fixed(double value) { return std::llround(std::ldexp(value, kFraction)); }

/// Deeper values are computed in 64 bits: weighted sums of chroma must fit into 15 bits.
constexpr int kMostFastDepth = 10;
constexpr int kMostFastShift = 1;

/// Returns twice the number of luma samples per chroma sample: the sum of one axis's weights.
int parts(int shift) { return 2 << shift; }

int chroma_size(int luma, int shift) { return (luma + (1 << shift) - 1) >> shift; }

std::vector<uint8_t> table_of_codes(int depth, bool full_range) {
  const int most = (1 << depth) - 1;
  const int low = full_range ? 0 : 16 << (depth - 8);
  const int span = full_range ? most : 219 << (depth - 8);
  std::vector<uint8_t> table(static_cast<size_t>(most) + 1);
  for (int v = 0; v <= most; ++v) {
    const int64_t scaled = 510 * int64_t{std::clamp(v - low, 0, span)} + span;
    table[static_cast<size_t>(v)] = static_cast<uint8_t>(scaled / (2 * span));
  }
  return table;
}

uint8_t clipped(int64_t sum) {
  return static_cast<uint8_t>(std::clamp<int64_t>((sum + kHalf) >> kFraction, 0, 255));
}

/// Returns the first byte of a component's row.
const uint8_t* row_of(const PicturePlanes& picture, const PixelComponent& c, int row) {
  const auto plane = static_cast<size_t>(c.plane);
  return picture.data[plane] + row * picture.stride[plane] + c.offset;
}

bool is_whole_byte(const PixelComponent& component) {
  return component.depth == 8 && component.shift == 0;
}

/// Returns true for 8-bit pictures whose chroma has half the columns.
bool suits_short_sums(const PixelLayout& layout) {
  return std::ranges::all_of(layout.components, is_whole_byte) && layout.components[0].step == 1 &&
         layout.chroma_shift_x == 1 && layout.chroma_shift_y <= kMostFastShift;
}

}  // namespace

PixelConverter::PixelConverter(const PixelLayout& layout, int width, int height, Isa isa)
    : layout_(layout),
      width_(width),
      height_(height),
      chroma_width_(chroma_size(width, layout.chroma_shift_x)),
      chroma_height_(chroma_size(height, layout.chroma_shift_y)),
      copies_bytes_(layout.model == ColourModel::Rgb &&
                    std::ranges::all_of(layout.components, is_whole_byte)),
      values_(static_cast<size_t>(width)),
      second_(static_cast<size_t>(width)),
      kernel_(&pixel_kernel(isa)) {
  LENTICULE_CHECK(width > 0 && height > 0);
  for (const PixelComponent& c : layout.components) LENTICULE_CHECK(c.depth >= 1 && c.depth <= 16);
  const bool limited = layout.model == ColourModel::Grey && !layout.full_range;
  LENTICULE_CHECK(layout.model == ColourModel::Rgb || layout.components[0].depth >= 8);
  code_of_value_ = table_of_codes(layout.components[0].depth, !limited);
  if (layout.model != ColourModel::Yuv) return;
  across_ = taps(width, layout.chroma_shift_x, layout.site.across);
  down_ = taps(height, layout.chroma_shift_y, layout.site.down);
  cb_.resize(static_cast<size_t>(width));
  cr_.resize(static_cast<size_t>(width));
  plan_matrix();
  const auto is_shallow = [](const PixelComponent& c) { return c.depth <= kMostFastDepth; };
  short_ = suits_short_sums(layout);
  fast_ = !short_ && std::ranges::all_of(layout.components, is_shallow) &&
          layout.chroma_shift_x <= kMostFastShift && layout.chroma_shift_y <= kMostFastShift;
  if (short_) plan_short_sums();
  if (fast_) plan_sums();
}

/// Chroma sample k lies at luma position n k + site (n - 1) / 2.
std::vector<PixelConverter::Tap> PixelConverter::taps(int luma, int shift, int site) {
  const int whole = parts(shift);
  const int last = chroma_size(luma, shift) - 1;
  const int begin = site * ((1 << shift) - 1);
  std::vector<Tap> all(static_cast<size_t>(luma));
  for (int x = 0; x < luma; ++x) {
    const int position = 2 * x - begin;
    const int first = position >= 0 ? position / whole : -1;
    all[static_cast<size_t>(x)] = {.first = std::clamp(first, 0, last),
                                   .second = std::clamp(first + 1, 0, last),
                                   .weight_second = position - first * whole};
  }
  return all;
}

void PixelConverter::plan_matrix() {
  const int depth = layout_.components[0].depth;
  const double one = std::ldexp(1.0, depth - 8);
  const double most = std::ldexp(1.0, depth) - 1.0;
  const double luma_span = layout_.full_range ? most : 219.0 * one;
  const double chroma_span = layout_.full_range ? most : 224.0 * one;
  const double black = layout_.full_range ? 0.0 : 16.0 * one;
  const double grey = 128.0 * one;
  const double kr = layout_.kr;
  const double kb = layout_.kb;
  const double kg = 1.0 - kr - kb;
  const int whole = parts(layout_.chroma_shift_x) * parts(layout_.chroma_shift_y);
  const double y = 255.0 / luma_span;
  const double c = 255.0 / chroma_span / whole;
  luma_ = fixed(y);
  red_cr_ = fixed(2.0 * (1.0 - kr) * c);
  green_cb_ = fixed(-2.0 * (1.0 - kb) * kb / kg * c);
  green_cr_ = fixed(-2.0 * (1.0 - kr) * kr / kg * c);
  blue_cb_ = fixed(2.0 * (1.0 - kb) * c);
  // Computed from the rounded coefficients, so that grey stays exactly grey.
  const auto zero = static_cast<int64_t>(grey) * whole;
  const int64_t black_part = luma_ * static_cast<int64_t>(black);
  red_0_ = -black_part - red_cr_ * zero;
  green_0_ = -black_part - (green_cb_ + green_cr_) * zero;
  blue_0_ = -black_part - blue_cb_ * zero;
}

/// Rounds the coefficients. Constants are computed from the rounded ones, so that only a chroma
/// value's distance from grey counts in the error.
void PixelConverter::plan_sums() {
  const auto rounded = [](int64_t value) {
    return static_cast<int32_t>((value + (int64_t{1} << (kFraction - kSumFraction - 1))) >>
                                (kFraction - kSumFraction));
  };
  const int depth = layout_.components[0].depth;
  const int whole = parts(layout_.chroma_shift_x) * parts(layout_.chroma_shift_y);
  const int32_t grey = (128 << (depth - 8)) * whole;
  const int32_t black = layout_.full_range ? 0 : 16 << (depth - 8);
  sums_ = {.luma = rounded(luma_),
           .red_cr = rounded(red_cr_),
           .green_cb = rounded(green_cb_),
           .green_cr = rounded(green_cr_),
           .blue_cb = rounded(blue_cb_),
           .red_0 = 0,
           .green_0 = 0,
           .blue_0 = 0,
           .error = 0};
  const int32_t constant = (1 << (kSumFraction - 1)) - sums_.luma * black;
  sums_.red_0 = constant - sums_.red_cr * grey;
  sums_.green_0 = constant - (sums_.green_cb + sums_.green_cr) * grey;
  sums_.blue_0 = constant - sums_.blue_cb * grey;
  // Half a unit for each code value of luma and part of two chroma values.
  sums_.error = (1 << depth) / 2 + grey + 1;
  const auto size = static_cast<size_t>(width_ + kPixelPadding);
  values_.resize(size);
  second_.resize(size);
  mixed_.resize(size);
  fast_cb_.resize(size);
  fast_cr_.resize(size);
  doubtful_.resize(size);
  row_.resize(3 * size);
}

/// Rounds the coefficients to 16 bits. The constant, which includes half a code, is rounded down:
/// with it every grey is exact, in both ranges.
void PixelConverter::plan_short_sums() {
  const auto rounded = [](int64_t value, int places) {
    const int shift = kFraction - places;
    return static_cast<int16_t>((value + (int64_t{1} << (shift - 1))) >> shift);
  };
  const int rows = parts(layout_.chroma_shift_y), whole = parts(1) * rows;
  const int64_t black = layout_.full_range ? 0 : 16;
  constexpr int kChromaPlaces = kShortFraction + 15 - 8, kLumaPlaces = kShortFraction + 15 - 7;
  const int site = layout_.site.across, unit = (1 << 8) / whole;
  short_sums_ = {
      .luma = rounded(luma_, kLumaPlaces),
      .constant = static_cast<int16_t>((1 << (kShortFraction - 1)) +
                                       ((-luma_ * black) >> (kFraction - kShortFraction))),
      .red_cr = rounded(red_cr_ * whole, kChromaPlaces),
      .green_cb = rounded(green_cb_ * whole, kChromaPlaces),
      .green_cr = rounded(green_cr_ * whole, kChromaPlaces),
      .blue_cb = rounded(blue_cb_ * whole, kChromaPlaces),
      .even = {unit * site, unit * (4 - site)},
      .odd = {unit * (2 + site), unit * (2 - site)}};
  second_.resize(static_cast<size_t>(width_));
  const auto size = static_cast<size_t>(chroma_width_ + 1 + kPixelPadding);
  fast_cb_.resize(size);
  fast_cr_.resize(size);
  row_.resize(size_t{4} * kPixelPadding);
}

void PixelConverter::convert(const PicturePlanes& picture, std::span<uint8_t> rgb) {
  LENTICULE_CHECK(picture.width == width_ && picture.height == height_);
  const size_t row_bytes = static_cast<size_t>(width_) * 3;
  LENTICULE_CHECK(rgb.size() == row_bytes * static_cast<size_t>(height_));
  for (int row = 0; row < height_; ++row) {
    uint8_t* out = rgb.data() + static_cast<size_t>(row) * row_bytes;
    switch (layout_.model) {
      case ColourModel::Rgb:
        rgb_row(picture, row, out);
        break;
      case ColourModel::Grey:
        grey_row(picture, row, out);
        break;
      case ColourModel::Yuv:
        short_  ? short_yuv_row(picture, row, out)
        : fast_ ? fast_yuv_row(picture, row, out)
                : yuv_row(picture, row, out);
        break;
    }
  }
}

void PixelConverter::unpack(const PicturePlanes& picture, int component, int row, int count,
                            uint16_t* out) const {
  const PixelComponent& c = layout_.components[static_cast<size_t>(component)];
  const uint8_t* in = row_of(picture, c, row);
  const auto mask = static_cast<unsigned>((1 << c.depth) - 1);
  const bool wide = c.shift + c.depth > 8;
  const int high = layout_.big_endian ? 0 : 1;
  if (is_whole_byte(c) && c.step == 1) {
    for (int x = 0; x < count; ++x) out[x] = in[x];
    return;
  }
  if (is_whole_byte(c) && c.step == 2) {  // a constant step is vectorised: Cb and Cr of NV12
    for (int x = 0; x < count; ++x) out[x] = in[2 * x];
    return;
  }
  if (wide && c.step == 2 && !layout_.big_endian && std::endian::native == std::endian::little) {
    std::memcpy(out, in, 2 * static_cast<size_t>(count));
    for (int x = 0; x < count; ++x) out[x] = static_cast<uint16_t>((out[x] >> c.shift) & mask);
    return;
  }
  for (int x = 0; x < count; ++x, in += c.step) {
    const unsigned word = wide ? static_cast<unsigned>(in[high] << 8 | in[1 - high]) : *in;
    out[x] = static_cast<uint16_t>((word >> c.shift) & mask);
  }
}

void PixelConverter::rgb_row(const PicturePlanes& picture, int row, uint8_t* out) {
  for (int channel = 0; channel < 3; ++channel) {
    if (copies_bytes_) {
      const PixelComponent& c = layout_.components[static_cast<size_t>(channel)];
      const uint8_t* in = row_of(picture, c, row);
      for (int x = 0; x < width_; ++x) out[3 * x + channel] = in[x * c.step];
      continue;
    }
    unpack(picture, channel, row, width_, values_.data());
    const int depth = layout_.components[static_cast<size_t>(channel)].depth;
    if (depth == layout_.components[0].depth) {
      for (int x = 0; x < width_; ++x) out[3 * x + channel] = code_of_value_[values_[x]];
      continue;
    }
    const int most = (1 << depth) - 1;  // 5-6-5: green is deeper
    for (int x = 0; x < width_; ++x)
      out[3 * x + channel] = static_cast<uint8_t>((510 * values_[x] + most) / (2 * most));
  }
}

void PixelConverter::grey_row(const PicturePlanes& picture, int row, uint8_t* out) {
  unpack(picture, 0, row, width_, values_.data());
  for (int x = 0; x < width_; ++x)
    out[3 * x] = out[3 * x + 1] = out[3 * x + 2] = code_of_value_[values_[x]];
}

/// Interpolates one chroma channel at every luma position of a row, in parts of a code value.
void PixelConverter::chroma_row(const PicturePlanes& picture, int component, int row,
                                std::vector<int32_t>& out) {
  const Tap& down = down_[static_cast<size_t>(row)];
  const int whole_x = parts(layout_.chroma_shift_x);
  const int whole_y = parts(layout_.chroma_shift_y);
  unpack(picture, component, down.first, chroma_width_, values_.data());
  unpack(picture, component, down.second, chroma_width_, second_.data());
  const int weight = down.weight_second;
  for (int x = 0; x < width_; ++x) {
    const Tap& tap = across_[static_cast<size_t>(x)];
    const int left = (whole_y - weight) * values_[tap.first] + weight * second_[tap.first];
    const int right = (whole_y - weight) * values_[tap.second] + weight * second_[tap.second];
    out[x] = (whole_x - tap.weight_second) * left + tap.weight_second * right;
  }
}

void PixelConverter::yuv_row(const PicturePlanes& picture, int row, uint8_t* out) {
  chroma_row(picture, 1, row, cb_);
  chroma_row(picture, 2, row, cr_);
  unpack(picture, 0, row, width_, values_.data());
  for (int x = 0; x < width_; ++x) exact_pixel(values_[x], cb_[x], cr_[x], out + 3 * x);
}

void PixelConverter::exact_pixel(int64_t luma, int64_t cb, int64_t cr, uint8_t* out) const {
  const int64_t y = luma_ * luma;
  out[0] = clipped(y + red_0_ + red_cr_ * cr);
  out[1] = clipped(y + green_0_ + green_cb_ * cb + green_cr_ * cr);
  out[2] = clipped(y + blue_0_ + blue_cb_ * cb);
}

/// Does the same as chroma_row() by the kernel.
void PixelConverter::fast_chroma_row(const PicturePlanes& picture, int component, int row,
                                     std::vector<int16_t>& out) {
  const Tap& down = down_[static_cast<size_t>(row)];
  const int whole = parts(layout_.chroma_shift_y), count = chroma_width_;
  int16_t* const mixed = mixed_.data() + 1;
  unpack(picture, component, down.first, count, values_.data());
  unpack(picture, component, down.second, count, second_.data());
  PairWeights weights{whole - down.weight_second, down.weight_second};
  if (layout_.chroma_shift_x == 0) {  // a sample per pixel, in two parts
    weights = {2 * weights.first, 2 * weights.second};
    return kernel_->mix_rows(values_.data(), second_.data(), weights, count, out.data());
  }
  kernel_->mix_rows(values_.data(), second_.data(), weights, count, mixed);
  mixed[-1] = mixed[0];
  mixed[count] = mixed[count - 1];
  // Even pixels lie at a sample or between it and the one before, odd ones between two samples.
  const int site = layout_.site.across;
  kernel_->spread(mixed, {site, 4 - site}, {2 + site, 2 - site}, count, out.data());
}

void PixelConverter::fast_yuv_row(const PicturePlanes& picture, int row, uint8_t* out) {
  fast_chroma_row(picture, 1, row, fast_cb_);
  fast_chroma_row(picture, 2, row, fast_cr_);
  unpack(picture, 0, row, width_, values_.data());
  // Whole blocks go directly to the picture; the kernel would write beyond its last row.
  const int whole = width_ / kPixelPadding * kPixelPadding;
  const auto convert = [&](int from, int count, uint8_t* rgb) {
    kernel_->convert(sums_, values_.data() + from, fast_cb_.data() + from, fast_cr_.data() + from,
                     count, rgb, doubtful_.data() + from);
  };
  convert(0, whole, out);
  if (whole < width_) {
    convert(whole, width_ - whole, row_.data());
    std::memcpy(out + 3 * whole, row_.data(), 3 * static_cast<size_t>(width_ - whole));
  }
  for (int x = 0; x < width_; x += 8) {
    uint64_t eight = 0;
    std::memcpy(&eight, doubtful_.data() + x, sizeof eight);
    for (int n = x; eight != 0 && n < std::min(x + 8, width_); ++n, eight >>= 8)
      if ((eight & 1) != 0) exact_pixel(values_[n], fast_cb_[n], fast_cr_[n], out + 3 * n);
  }
}

/// Writes the weighted sums of two rows of samples, from out[1] on, and repeats the outermost ones.
void PixelConverter::short_chroma_row(const PicturePlanes& picture, int component, int row,
                                      std::vector<int16_t>& out) {
  const PixelComponent& c = layout_.components[static_cast<size_t>(component)];
  const Tap& down = down_[static_cast<size_t>(row)];
  const PairWeights weights{parts(layout_.chroma_shift_y) - down.weight_second, down.weight_second};
  const int count = chroma_width_;
  int16_t* const mixed = out.data() + 1;
  if (c.step == 1) {
    kernel_->mix_bytes(row_of(picture, c, down.first), row_of(picture, c, down.second), weights,
                       count, mixed);
  } else {
    unpack(picture, component, down.first, count, values_.data());
    unpack(picture, component, down.second, count, second_.data());
    kernel_->mix_rows(values_.data(), second_.data(), weights, count, mixed);
  }
  mixed[-1] = mixed[0];
  mixed[count] = mixed[count - 1];
}

void PixelConverter::short_yuv_row(const PicturePlanes& picture, int row, uint8_t* out) {
  short_chroma_row(picture, 1, row, fast_cb_);
  short_chroma_row(picture, 2, row, fast_cr_);
  const uint8_t* const luma = row_of(picture, layout_.components[0], row);
  const auto convert = [&](const uint8_t* y, int from, int count, uint8_t* rgb) {
    kernel_->convert_short(short_sums_, y, fast_cb_.data() + 1 + from / 2,
                           fast_cr_.data() + 1 + from / 2, count, rgb);
  };
  const int whole = width_ / kPixelPadding * kPixelPadding;
  convert(luma, 0, whole, out);
  if (whole == width_) return;
  // The last pixels become a block of their own, because neither row may have room for one.
  const auto rest = static_cast<size_t>(width_ - whole);
  uint8_t* const rgb = row_.data() + kPixelPadding;
  std::memcpy(row_.data(), luma + whole, rest);
  convert(row_.data(), whole, kPixelPadding, rgb);
  std::memcpy(out + 3 * whole, rgb, 3 * rest);
}

const PixelKernel& pixel_kernel(Isa isa) {
#if defined(__x86_64__)
  if (!__builtin_cpu_supports("avx512vbmi")) isa = std::min(isa, Isa::Avx2);
#endif
  return LENTICULE_SELECT_KERNEL(isa, kPixelKernel);
}

}  // namespace lenticule::video
