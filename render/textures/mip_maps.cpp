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

double clamped01(double v) { return v > 0.0 ? std::min(v, 1.0) : 0.0; }

const std::array<double, 256>& share_of_codes() {
  static const std::array<double, 256> shares = [] {
    std::array<double, 256> all{};
    for (size_t code = 0; code < all.size(); ++code) all[code] = static_cast<double>(code) / 255.0;
    return all;
  }();
  return shares;
}

uint8_t nearest_code(double v) { return static_cast<uint8_t>(clamped01(v) * 255.0 + 0.5); }

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
  texels_ = {.levels = views_.data(),
             .count = static_cast<int32_t>(views_.size()),
             .content = content_,
             .light_of_code = light_of_codes().data(),
             .repeat = {shape_.repeat_u, shape_.repeat_v},
             .mirror = {shape_.mirror_u, shape_.mirror_v}};
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

void MipMaps::find(const texel_kernel::Area& area, TextureLookup& lookup) const {
  lookup.shape = shape_;
  kernel_.find(texels_, area, lookup.texels);
}

void MipMaps::values(const TextureLookup& lookup, texel_kernel::Values& out) const {
  kernel_.mean(texels_, lookup.texels, out);
}

Value MipMaps::value(Vec2 at, const TextureFootprint& footprint) const {
  texel_kernel::Area area{};
  set_lane(area, 0, at, footprint);
  TextureLookup lookup;
  find(area, lookup);
  std::fill(std::begin(lookup.texels.places) + 1, std::end(lookup.texels.places), 0);
  texel_kernel::Values values;
  kernel_.mean(texels_, lookup.texels, values);
  Value mean;
  for (size_t c = 0; c < mean.size(); ++c) mean[c] = double{values.channel[c][0]};
  return mean;
}

}  // namespace lenticule::render
