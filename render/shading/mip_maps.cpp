// SPDX-License-Identifier: Apache-2.0
#include "render/shading/mip_maps.h"

#include <oneapi/tbb/parallel_for.h>

#include <algorithm>
#include <cmath>
#include <cstring>

#include "frames/srgb.h"

namespace lenticule::render {
namespace {

using Value = MipMaps::Value;

/// Most lookups along the longer axis of a footprint; longer ones are blurred across as well.
constexpr double kMostProbes = 16.0;

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

/// Two neighbouring texels along one axis and the weight of the second.
struct Neighbours {
  int first;
  int second;
  float part;
};

/// Returns the distance of a coordinate above the next lower integer. Does not use std::floor,
/// which is a function call without SSE4.
double beyond_whole(double coordinate) {
  const double beyond = coordinate - static_cast<double>(static_cast<int64_t>(coordinate));
  return beyond < 0.0 ? beyond + 1.0 : beyond;
}

/// Returns the place in the picture, 0 to 1, of a coordinate beyond it.
double place_in_picture(double coordinate, bool repeat, bool mirror) {
  if (!(std::abs(coordinate) < 1e15)) coordinate = 0.0;
  if (!repeat) return std::clamp(coordinate, 0.0, 1.0);
  if (!mirror) return beyond_whole(coordinate);
  const double in_pair = 2.0 * beyond_whole(0.5 * coordinate);
  return in_pair > 1.0 ? 2.0 - in_pair : in_pair;
}

/// `wraps`: the texel beyond the border is that of the other side, otherwise the border's own.
Neighbours neighbours(double place, int size, bool wraps) {
  // Measured from half a texel before the first one, so that truncation rounds down.
  const double texel = place * size + 0.5;
  const int second = static_cast<int>(texel), first = second - 1;
  const auto part = static_cast<float>(texel - second);
  const int before = wraps ? size - 1 : 0, behind = wraps ? 0 : size - 1;
  return {first < 0 ? before : first, second >= size ? behind : second, part};
}

/// The four channels of a texel.
using Four = float __attribute__((vector_size(16)));

Four mixed(Four a, Four b, float part) {
  return a + (b - a) * part;
}

/// Returns the values of the 256 codes in single precision.
std::array<float, 256> in_singles(const std::array<double, 256>& values) {
  std::array<float, 256> out{};
  for (size_t code = 0; code < out.size(); ++code) out[code] = static_cast<float>(values[code]);
  return out;
}
const float* light_of_code() {
  static const std::array<float, 256> light = in_singles(frames::linear_of_codes());
  return light.data();
}
const float* share_of_code() {
  static const std::array<float, 256> shares = in_singles(share_of_codes());
  return shares.data();
}

}  // namespace

MipMaps::MipMaps(std::shared_ptr<const Texture> texture, Content content)
    : texture_(std::move(texture)),
      content_(content),
      colour_of_code_(content == Content::Colour ? frames::linear_of_codes().data()
                                                 : share_of_codes().data()) {
  for (LevelView last = level(0); last.width > 1 || last.height > 1; last = level(levels_.size()))
    levels_.push_back(halved(last));
}

MipMaps::LevelView MipMaps::level(size_t number) const {
  if (number == 0)
    return {texture_->width, texture_->height,
            texture_->codes.empty() ? nullptr : texture_->codes.data(), texture_->rgba.data(),
            true};
  const Level& l = levels_[number - 1];
  return {l.width, l.height, l.codes.empty() ? nullptr : l.codes.data(), l.values.data(), false};
}

Value MipMaps::texel(const LevelView& from, int x, int y) const {
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
  const double held = from.is_first ? 1.0 : 1.0 - value[3] * value[3];
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

MipMaps::Level MipMaps::halved(const LevelView& from) const {
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

/// Sampler interpolates between texels of two levels, in single precision.
class MipMaps::Sampler {
 public:
  /// `depth` counts levels.
  Sampler(const MipMaps& maps, double depth)
      : texture_(*maps.texture_),
        is_normals_(maps.content_ == Content::Normals),
        colour_of_code_(maps.content_ == Content::Colour ? light_of_code() : share_of_code()),
        share_of_code_(share_of_code()) {
    const auto sharper = static_cast<size_t>(depth);
    fine_ = maps.level(sharper);
    part_ = static_cast<float>(depth - static_cast<double>(sharper));
    if (part_ > 0.0F) coarse_ = maps.level(std::min(sharper + 1, maps.levels_.size()));
  }

  [[nodiscard]] Four at(Vec2 at) const {
    const Vec2 place{place_in_picture(at.x, texture_.repeat_u, texture_.mirror_u),
                     place_in_picture(at.y, texture_.repeat_v, texture_.mirror_v)};
    const Four value = bilinear(fine_, place);
    return part_ > 0.0F ? mixed(value, bilinear(coarse_, place), part_) : value;
  }

 private:
  [[nodiscard]] Four bilinear(const LevelView& from, Vec2 place) const {
    // A mirrored border continues as an extended one does.
    const Neighbours x = neighbours(place.x, from.width, texture_.repeat_u && !texture_.mirror_u);
    const Neighbours y = neighbours(place.y, from.height, texture_.repeat_v && !texture_.mirror_v);
    return mixed(mixed(texel(from, x.first, y.first), texel(from, x.second, y.first), x.part),
                 mixed(texel(from, x.first, y.second), texel(from, x.second, y.second), x.part),
                 y.part);
  }

  [[nodiscard]] Four texel(const LevelView& from, int x, int y) const {
    const size_t at =
        4 * (static_cast<size_t>(y) * static_cast<size_t>(from.width) + static_cast<size_t>(x));
    Four value;
    if (from.codes == nullptr) {
      std::memcpy(&value, from.values + at, sizeof value);
    } else {
      const uint8_t* code = from.codes + at;
      value = Four{colour_of_code_[code[0]], colour_of_code_[code[1]], colour_of_code_[code[2]],
                   share_of_code_[code[3]]};
    }
    return is_normals_ ? vector_of(value, from.is_first) : value;
  }

  /// Returns the mean vector of a texel of a normal map, as MipMaps::texel() does.
  static Four vector_of(Four value, bool is_first) {
    const Four vector = 2.0F * value - 1.0F;
    const float size =
        std::sqrt(vector[0] * vector[0] + vector[1] * vector[1] + vector[2] * vector[2]);
    const float held = is_first ? 1.0F : 1.0F - value[3] * value[3];
    return size > 0.0F ? vector * (held / size) : Four{0.0F, 0.0F, held, 0.0F};
  }

  const Texture& texture_;
  bool is_normals_;
  const float* colour_of_code_;
  const float* share_of_code_;
  LevelView fine_{}, coarse_{};
  float part_ = 0.0F;
};

Value MipMaps::value(Vec2 at, const TextureFootprint& footprint) const {
  const auto texels = [&](Vec2 v) { return Vec2{v.x * texture_->width, v.y * texture_->height}; };
  const Ellipse area = ellipse_around(texels(footprint.across), texels(footprint.along));
  const auto last = static_cast<double>(levels_.size());
  const double width = std::max({area.minor, area.major / kMostProbes, 1.0});
  // Not finite at the horizon of a plane.
  const double depth = width <= 1.0  ? 0.0
                       : width < 1e9 ? std::min(double{std::log2(static_cast<float>(width))}, last)
                                     : last;
  const Sampler sampler(*this, depth);
  const auto value_of = [](Four v) {
    return Value{double{v[0]}, double{v[1]}, double{v[2]}, double{v[3]}};
  };
  const double longer = area.major / width;
  if (!(longer > 1.0 + 1e-6) || !std::isfinite(area.major)) return value_of(sampler.at(at));
  const int probes = longer < kMostProbes ? static_cast<int>(std::ceil(longer - 1e-6))
                                          : static_cast<int>(kMostProbes);
  const Vec2 axis{area.major_axis.x * area.major / texture_->width,
                  area.major_axis.y * area.major / texture_->height};
  Four sum{};
  for (int n = 0; n < probes; ++n) sum += sampler.at(at + axis * ((n + 0.5) / probes - 0.5));
  return value_of(sum * (1.0F / static_cast<float>(probes)));
}

}  // namespace lenticule::render
