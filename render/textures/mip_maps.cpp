// SPDX-License-Identifier: Apache-2.0
#include "render/textures/mip_maps.h"

#include <oneapi/tbb/parallel_for.h>

#include <algorithm>
#include <cmath>

#include "frames/srgb.h"
#include "render/scene/texture.h"

namespace lenticule::render {
namespace {

using Value = MipMaps::Value;

/// Most lookups along the longer axis of a footprint; longer ones are blurred across as well.
constexpr double kMostProbes = texel_kernel::kPlaces;

double clamped01(double v) {
  return v > 0.0 ? std::min(v, 1.0) : 0.0;
}

const std::array<double, 256>& share_of_codes() {
  static const std::array<double, 256> shares = [] {
    std::array<double, 256> all{};
    for (size_t code = 0; code < all.size(); ++code) all[code] = static_cast<double>(code) / 255.0;
    return all;
  }();
  return shares;
}

uint8_t nearest_code(double v) {
  return static_cast<uint8_t>(clamped01(v) * 255.0 + 0.5);
}

/// Returns the sRGB codes of the shares n / kLightSteps of white's light.
constexpr uint32_t kLightSteps = 1U << 14;
const std::vector<uint8_t>& codes_of_light() {
  static const std::vector<uint8_t> codes = [] {
    std::vector<uint8_t> all(kLightSteps + 1);
    for (size_t n = 0; n < all.size(); ++n)
      all[n] = frames::code_from_linear(static_cast<double>(n) / kLightSteps);
    return all;
  }();
  return codes;
}

/// Returns the sRGB code of light, within one code, faster than frames::code_from_linear().
uint8_t colour_code(double light) {
  return codes_of_light()[static_cast<size_t>(clamped01(light) * kLightSteps + 0.5)];
}

/// Averages a row of squares of two by two texels, whose upper and lower texels begin at these
/// codes. Integers are several times as fast as halved(), which does the same for any size.
void halve_codes(const uint8_t* upper, const uint8_t* lower, int width, bool is_colour,
                 uint8_t* out) {
  // Light of the codes in units of 1 / (kUnits kLightSteps).
  constexpr uint32_t kUnits = 1U << 10;
  static const std::array<uint32_t, 256> light = [] {
    std::array<uint32_t, 256> all{};
    for (size_t code = 0; code < all.size(); ++code)
      all[code] = static_cast<uint32_t>(
          std::lround(frames::linear_of_codes()[code] * double{kUnits} * double{kLightSteps}));
    return all;
  }();
  const uint8_t* const codes = codes_of_light().data();
  for (int x = 0; x < width; ++x, upper += 8, lower += 8, out += 4) {
    for (size_t c = 0; c < 4; ++c) {
      const uint8_t four[] = {upper[c], upper[c + 4], lower[c], lower[c + 4]};
      out[c] = is_colour && c < 3
                   ? codes[(light[four[0]] + light[four[1]] + light[four[2]] + light[four[3]] +
                            2 * kUnits) /
                           (4 * kUnits)]
                   : static_cast<uint8_t>((four[0] + four[1] + four[2] + four[3] + 2) / 4);
    }
  }
}

void add(const Value& value, double weight, Value& sum) {
  for (size_t c = 0; c < sum.size(); ++c) sum[c] += weight * value[c];
}

/// Returns the texels of a row of `size` that one texel of a row half as long covers.
struct Covered {
  int first;
  int count;
  std::array<double, 3> weights;
};
Covered covered(int texel, int size, int half) {
  const double step = static_cast<double>(size) / half;
  const double begin = texel * step, end = begin + step;
  Covered out{.first = static_cast<int>(begin), .count = 0, .weights = {}};
  for (int n = out.first; n < size && n < end && out.count < 3; ++n)
    out.weights[static_cast<size_t>(out.count++)] =
        (std::min(end, n + 1.0) - std::max(begin, n * 1.0)) / step;
  return out;
}

/// The axes of the ellipse around a parallelogram, in texels.
struct Ellipse {
  double minor = 0.0;
  double major = 0.0;
  Vec2 major_axis{1, 0};  ///< unit
};

Ellipse ellipse_around(Vec2 a, Vec2 b) {
  // Eigenvalues of the sum of the outer products of both sides.
  const double xx = a.x * a.x + b.x * b.x, yy = a.y * a.y + b.y * b.y;
  const double xy = a.x * a.y + b.x * b.y;
  const double middle = 0.5 * (xx + yy), half = 0.5 * (xx - yy);
  const double apart = std::sqrt(half * half + xy * xy);
  Ellipse out;
  out.major = std::sqrt(middle + apart);
  // The product of both axes is the area, which the difference would lose to rounding.
  const double area = std::abs(a.x * b.y - a.y * b.x);
  out.minor = out.major > 0.0 ? area / out.major : 0.0;
  const Vec2 axis =
      xx >= yy ? Vec2{0.5 * (xx - yy) + apart, xy} : Vec2{xy, 0.5 * (yy - xx) + apart};
  const double size = std::sqrt(axis.x * axis.x + axis.y * axis.y);
  if (size > 0.0) out.major_axis = {axis.x / size, axis.y / size};
  return out;
}

}  // namespace

MipMaps::MipMaps(std::shared_ptr<const Texture> texture, Content content)
    : texture_(std::move(texture)),
      shape_{.width = texture_->width,
             .height = texture_->height,
             .repeat_u = texture_->repeat_u,
             .mirror_u = texture_->mirror_u,
             .repeat_v = texture_->repeat_v,
             .mirror_v = texture_->mirror_v},
      content_(content),
      kernel_(LENTICULE_SELECT_KERNEL(best_isa(), kTexelKernel)),
      colour_of_code_(content == Content::Colour ? frames::linear_of_codes().data()
                                                 : share_of_codes().data()) {
  const auto add_view = [&](int width, int height, const auto& codes, const auto& values) {
    views_.push_back({width, height, codes.empty() ? nullptr : codes.data(), values.data(),
                      views_.empty() ? 1 : 0});
  };
  add_view(texture_->width, texture_->height, texture_->codes, texture_->rgba);
  while (views_.back().width > 1 || views_.back().height > 1) {
    const Level& level = levels_.emplace_back(halved(views_.back()));
    add_view(level.width, level.height, level.codes, level.values);
  }
  views_.push_back(views_.back());
}

Value MipMaps::texel(const texel_kernel::Level& from, int x, int y) const {
  const size_t at =
      4 * (static_cast<size_t>(y) * static_cast<size_t>(from.width) + static_cast<size_t>(x));
  Value value;
  if (from.codes == nullptr) {
    for (size_t c = 0; c < 4; ++c) value[c] = double{from.values[at + c]};
  } else {
    const uint8_t* code = from.codes + at;
    value = {colour_of_code_[code[0]], colour_of_code_[code[1]], colour_of_code_[code[2]],
             share_of_codes()[code[3]]};
  }
  if (content_ != Content::Normals) return value;
  const Vec3 vector{2.0 * value[0] - 1.0, 2.0 * value[1] - 1.0, 2.0 * value[2] - 1.0};
  const double size = length(vector);
  // The levels store the root, since 1 - length is small.
  const double held = from.is_first != 0 ? 1.0 : 1.0 - value[3] * value[3];
  const Vec3 scaled = size > 0.0 ? vector * (held / size) : Vec3{0, 0, held};
  return {scaled.x, scaled.y, scaled.z, 0.0};
}

void MipMaps::store(const Value& value, size_t index, Level& to) const {
  Value out = value;
  if (content_ == Content::Normals) {
    const Vec3 mean{value[0], value[1], value[2]};
    const double size = std::min(1.0, length(mean));
    const Vec3 unit = size > 0.0 ? normalized(mean) : Vec3{0, 0, 1};
    out = {0.5 + 0.5 * unit.x, 0.5 + 0.5 * unit.y, 0.5 + 0.5 * unit.z, std::sqrt(1.0 - size)};
  }
  for (size_t c = 0; c < 4; ++c) {
    if (to.codes.empty())
      to.values[4 * index + c] = static_cast<float>(out[c]);
    else
      to.codes[4 * index + c] =
          content_ == Content::Colour && c < 3 ? colour_code(out[c]) : nearest_code(out[c]);
  }
}

MipMaps::Level MipMaps::halved(const texel_kernel::Level& from) const {
  Level to{.width = std::max(1, from.width / 2), .height = std::max(1, from.height / 2)};
  const size_t values = 4 * static_cast<size_t>(to.width) * static_cast<size_t>(to.height);
  if (from.codes != nullptr)
    to.codes.resize(values);
  else
    to.values.resize(values);
  const bool is_doubled = from.width == 2 * to.width && from.height == 2 * to.height;
  if (from.codes != nullptr && is_doubled && content_ != Content::Normals) {
    const size_t row = 4 * static_cast<size_t>(from.width);
    tbb::parallel_for(0, to.height, [&](int y) {
      const uint8_t* upper = from.codes + 2 * static_cast<size_t>(y) * row;
      halve_codes(upper, upper + row, to.width, content_ == Content::Colour,
                  to.codes.data() + static_cast<size_t>(y) * row / 2);
    });
    return to;
  }
  tbb::parallel_for(0, to.height, [&](int y) {
    const Covered rows = covered(y, from.height, to.height);
    for (int x = 0; x < to.width; ++x) {
      const Covered columns = covered(x, from.width, to.width);
      Value sum{};
      for (int j = 0; j < rows.count; ++j)
        for (int i = 0; i < columns.count; ++i)
          add(texel(from, columns.first + i, rows.first + j),
              rows.weights[static_cast<size_t>(j)] * columns.weights[static_cast<size_t>(i)], sum);
      store(sum, static_cast<size_t>(y) * static_cast<size_t>(to.width) + static_cast<size_t>(x),
            to);
    }
  });
  return to;
}

/// Returns the level, between two if it is not a whole number, whose texels are `width` of those of
/// the texture wide.
double MipMaps::depth_of(double width) const {
  const auto last = static_cast<double>(levels_.size());
  if (width <= 1.0) return 0.0;
  // Not finite at the horizon of a plane.
  return width < 1e9 ? std::min(double{std::log2(static_cast<float>(width))}, last) : last;
}

void MipMaps::find(Vec2 at, const TextureFootprint& footprint, TextureLookup& lookup) const {
  const auto texels = [&](Vec2 v) { return Vec2{v.x * shape_.width, v.y * shape_.height}; };
  const Ellipse area = ellipse_around(texels(footprint.across), texels(footprint.along));
  const double width = std::max({area.minor, area.major / kMostProbes, 1.0});
  const double depth = depth_of(width);
  lookup.shape = shape_;
  lookup.fine = static_cast<size_t>(depth);
  texel_kernel::Lookup& out = lookup.texels;
  out.of_coarse = static_cast<float>(depth - static_cast<double>(lookup.fine));

  const double longer = area.major / width;
  const bool is_long = longer > 1.0 + 1e-6 && std::isfinite(area.major);
  out.places = !is_long               ? 1
               : longer < kMostProbes ? static_cast<int>(std::ceil(longer - 1e-6))
                                      : texel_kernel::kPlaces;
  const Vec2 axis = is_long ? Vec2{area.major_axis.x * area.major / shape_.width,
                                   area.major_axis.y * area.major / shape_.height}
                            : Vec2{};
  const texel_kernel::Level& fine = views_[lookup.fine];
  const texel_kernel::Level& coarse = views_[lookup.fine + 1];
  kernel_.find({.middle = {at.x, at.y},
                .length = {axis.x, axis.y},
                .repeat = {shape_.repeat_u, shape_.repeat_v},
                .mirror = {shape_.mirror_u, shape_.mirror_v},
                .fine_size = {fine.width, fine.height},
                .coarse_size = {coarse.width, coarse.height}},
               out);
}

Value MipMaps::value(const TextureLookup& lookup) const {
  std::array<float, 4> mean;
  kernel_.mean(content_, light_of_codes().data(), views_[lookup.fine], views_[lookup.fine + 1],
               lookup.texels, mean.data());
  return {double{mean[0]}, double{mean[1]}, double{mean[2]}, double{mean[3]}};
}

Value MipMaps::value(Vec2 at, const TextureFootprint& footprint) const {
  TextureLookup lookup;
  find(at, footprint, lookup);
  return value(lookup);
}

}  // namespace lenticule::render
