// SPDX-License-Identifier: Apache-2.0
#include "frames/views_input/depth_views.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "base/error_kinds.h"
#include "frames/weaving/crosstalk.h"

namespace lenticule::frames {
namespace {

constexpr double kMostDisparity = 2.0;  // widths; a larger value is invalid
constexpr int kBandRows = 8;
constexpr double kNothing = -std::numeric_limits<double>::infinity();
constexpr int kWhole = 1 << 15;

int checked_views(int width, int height, const DepthOptions& options) {
  if (options.views < 2 || options.views > kMaxViews)
    throw usage_error("depth: {} views are out of range", options.views)
        .remedy(fmt::format("2 to {} views can be made from a picture and its depth", kMaxViews));
  const uint64_t bytes = FrameGeometry{.width = width, .height = height}.frame_bytes();
  if (bytes > options.most_bytes / static_cast<uint64_t>(options.views))
    throw input_error("depth: {} views of {} x {} pixels are more than {} MiB, the limit",
                      options.views, width, height, options.most_bytes >> 20)
        .remedy("use fewer --views");
  return options.views;
}

/// Returns the disparity of each code, in pixels.
std::vector<double> disparities(int width, const DepthOptions& options) {
  const double unit = options.in_pixels ? 1.0 : width;
  const double zero_plane = options.zero_plane.pixels(width);
  const auto sensible = [&](double disparity) {
    return std::abs(disparity * unit - zero_plane) <= kMostDisparity * width;  // false for NaN
  };
  if (!sensible(options.back) || !sensible(options.front))
    throw Error(
        ErrorKind::Usage,
        fmt::format("depth: disparities of {} to {} are out of range", options.back, options.front),
        "the limit is twice a view's width");
  std::vector<double> table(256);
  for (size_t code = 0; code < table.size(); ++code) {
    const double near = static_cast<double>(options.black_is_near ? 255 - code : code) / 255.0;
    // With z the distance, 1 for the nearest and r for the farthest: (1/z - 1/r) / (1 - 1/r).
    const double ratio = options.distance_ratio;
    const double share = near / (ratio + (1.0 - ratio) * near);
    table[code] = unit * (options.back + (options.front - options.back) * share) - zero_plane;
  }
  const double most = options.most * width;
  const double largest = std::max(std::abs(table.front()), std::abs(table.back()));
  if (largest > most)
    for (double& disparity : table)
      disparity /= 1.0 + std::abs(disparity) * (1.0 / most - 1.0 / largest);
  return table;
}

}  // namespace

PictureWindow window_of(const FrameView& picture) {
  return {.pixels = picture.bytes.data(),
          .stride_bytes = picture.geometry.row_bytes(),
          .width = picture.geometry.width,
          .height = picture.geometry.height};
}

/// Target is the source of one pixel of a view.
struct DepthViews::Target {
  double disparity = kNothing;
  int source = 0;
  int share = 0;  ///< weight of the pixel right of the source, in 1 / kWhole
};

struct DepthViews::Scratch {
  explicit Scratch(size_t width)
      : disparity(width), joined(width + 1), light(width * 3), codes(width * 3), target(width) {}
  std::vector<double> disparity;
  std::vector<uint8_t> joined;  ///< true if joined with the previous pixel; false at both ends
  std::vector<uint16_t> light;
  std::vector<uint8_t> codes;
  std::vector<Target> target;
};

DepthViews::DepthViews(int width, int height, const DepthOptions& options)
    : width_(width),
      height_(height),
      options_(options),
      disparity_of_code_(disparities(width, options)),
      pictures_(static_cast<size_t>(checked_views(width, height, options)),
                WovenFrame({.width = width, .height = height})),
      workers_(std::max(1, options.threads)) {
  for (const WovenFrame& picture : pictures_) views_.push_back(picture.view());
  for (int worker = 0; worker < workers_.count(); ++worker)
    scratches_.push_back(std::make_unique<Scratch>(static_cast<size_t>(width)));
}
DepthViews::~DepthViews() = default;

std::span<const FrameView> DepthViews::draw(const PictureWindow& colour,
                                            const PictureWindow& depth) {
  LENTICULE_CHECK(colour.width == width_ && colour.height == height_);
  LENTICULE_CHECK(depth.width > 0 && depth.height > 0);
  const int bands = (height_ + kBandRows - 1) / kBandRows;
  workers_.run(bands, [&](int band, int worker) {
    const int end = std::min((band + 1) * kBandRows, height_);
    for (int row = band * kBandRows; row < end; ++row)
      draw_row(row, colour, depth, *scratches_[static_cast<size_t>(worker)]);
  });
  return views_;
}

void DepthViews::draw_row(int row, const PictureWindow& colour, const PictureWindow& depth,
                          Scratch& scratch) {
  read_row(row, colour, depth, scratch);
  const double last = options_.views - 1;
  for (size_t view = 0; view < pictures_.size(); ++view) {
    move_row((static_cast<double>(view) - last / 2.0) / last, scratch);
    fill_holes(scratch);
    paint_row(scratch, pictures_[view].row(row));
  }
}

void DepthViews::read_row(int row, const PictureWindow& colour, const PictureWindow& depth,
                          Scratch& scratch) const {
  const auto across = [](int at, int from, int to) {  // pixel at the same relative position
    return static_cast<int>((2 * static_cast<int64_t>(at) + 1) * to / (2 * from));
  };
  const uint8_t* const depths = depth.row(across(row, height_, depth.height));
  for (int i = 0; i < width_; ++i) {
    const uint8_t* const rgb = depths + static_cast<size_t>(across(i, width_, depth.width)) * 3;
    const int grey = (rgb[0] + rgb[1] + rgb[2] + 1) / 3;
    scratch.disparity[static_cast<size_t>(i)] = disparity_of_code_[static_cast<size_t>(grey)];
  }
  for (size_t i = 1; i < scratch.disparity.size(); ++i)
    scratch.joined[i] =
        std::abs(scratch.disparity[i] - scratch.disparity[i - 1]) <= kJoinedDisparity ? 1 : 0;
  std::copy_n(colour.row(row), scratch.codes.size(), scratch.codes.begin());
  for (size_t n = 0; n < scratch.codes.size(); ++n)
    scratch.light[n] = light_of_codes15()[scratch.codes[n]];
}

/// Draws the pieces of the row, nearer ones over farther ones; of equally near ones the left one.
void DepthViews::move_row(double turn, Scratch& scratch) const {
  std::fill(scratch.target.begin(), scratch.target.end(), Target{});
  // Draws from x = begin to end; the weight grows from 0 to `most`.
  const auto lay = [&](int source, double begin, double end, double farther, double most) {
    const double near = scratch.disparity[static_cast<size_t>(source)];
    const int first = std::max(0, static_cast<int>(std::ceil(begin - 0.5)));
    for (int k = first; k < width_ && k + 0.5 < end; ++k) {
      const double share = most * (k + 0.5 - begin) / (end - begin);
      const double disparity = near + share * (farther - near);
      Target& target = scratch.target[static_cast<size_t>(k)];
      if (disparity > target.disparity)
        target = {.disparity = disparity,
                  .source = source,
                  .share = static_cast<int>(share * kWhole + 0.5)};
    }
  };
  for (int i = 0; i < width_; ++i) {
    const auto at = static_cast<size_t>(i);
    const double disparity = scratch.disparity[at];
    const double x = i + 0.5 - disparity * turn;
    if (scratch.joined[at] == 0) lay(i, x - 0.5, x, disparity, 0.0);
    if (scratch.joined[at + 1] == 0) {
      lay(i, x, x + 0.5, disparity, 0.0);
    } else {
      const double next = scratch.disparity[at + 1];
      lay(i, x, i + 1.5 - next * turn, next, 1.0);
    }
  }
}

/// Fills holes from the farther side, one pixel away from the edge, since the edge pixel may be a
/// mixture.
void DepthViews::fill_holes(Scratch& scratch) const {
  std::vector<Target>& row = scratch.target;
  const auto inner = [&](const Target& edge, int step) {
    const int beside = edge.source + step;
    const bool same = scratch.joined[static_cast<size_t>(std::max(edge.source, beside))] != 0;
    return Target{.disparity = edge.disparity, .source = same ? beside : edge.source, .share = 0};
  };
  size_t begin = 0;
  while (begin < row.size()) {
    if (row[begin].disparity != kNothing) {
      ++begin;
      continue;
    }
    size_t end = begin;
    while (end < row.size() && row[end].disparity == kNothing) ++end;
    const bool has_left = begin > 0, has_right = end < row.size();
    const bool left = has_left && (!has_right || row[begin - 1].disparity <= row[end].disparity);
    Target fill{.disparity = 0.0, .source = static_cast<int>(begin), .share = 0};
    if (left) fill = inner(row[begin - 1], -1);
    if (!left && has_right) fill = inner(row[end], 1);
    fill.source = std::clamp(fill.source, 0, width_ - 1);
    std::fill(row.begin() + static_cast<ptrdiff_t>(begin),
              row.begin() + static_cast<ptrdiff_t>(end), fill);
    begin = end;
  }
}

void DepthViews::paint_row(const Scratch& scratch, uint8_t* to) const {
  const auto& codes = codes_of_light15();
  for (const Target& target : scratch.target) {
    const size_t from = static_cast<size_t>(target.source) * 3;
    for (size_t channel = 0; channel < 3; ++channel, ++to) {
      *to = scratch.codes[from + channel];
      if (target.share == 0) continue;
      const int here = scratch.light[from + channel], next = scratch.light[from + 3 + channel];
      if (here == next) continue;
      *to = codes[static_cast<size_t>(here + (next - here) * target.share / kWhole)];
    }
  }
}

}  // namespace lenticule::frames
