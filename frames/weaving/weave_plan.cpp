// SPDX-License-Identifier: Apache-2.0
#include "frames/weaving/weave_plan.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>
#include <utility>

#include "base/error.h"
#include "base/statistics.h"
#include "base/worker_threads.h"
#include "frames/weaving/plan_kernel.h"
#include "optics/row_rays.h"

namespace lenticule::frames {

using weave_kernel::kRows;
using weave_kernel::kViewBits;
using weave_kernel::kWeightBits;
using weave_kernel::Quad;
using weave_kernel::Set;

namespace {

constexpr int kBlocksPerPart = 44;
/// Upper limit of a segment's length, with which the places of a set fit in 16 bits. A segment is
/// the largest multiple of the layout's columns below it.
constexpr int kSegmentPixels = 16384;
constexpr double kViewUnit = 1 << kViewBits;
constexpr double kColumnUnit = 1 << kWeightBits;

/// Line holds the places of one row of a set, as the rays give them.
struct Line {
  std::vector<double> view;    ///< numbers, in (0, views]
  std::vector<double> column;  ///< picture pixels from the first one's centre, within the picture
  std::vector<int32_t> lens;
  std::vector<uint8_t> black;
  double row = 0.0;
  int places = 0;

  void resize(size_t count) {
    constexpr size_t kPadding = plan_kernel::kPadding;
    view.resize(count + kPadding);
    column.resize(count + kPadding);
    lens.resize(count + kPadding);
    black.resize(count + kPadding);
    places = static_cast<int>(count);
  }
  [[nodiscard]] plan_kernel::Line terms() const {
    return {view.data(), column.data(), lens.data(), black.data(), places};
  }
};

int rounded(double value) { return static_cast<int>(std::lround(value)); }

plan_kernel::Numbers numbers_of(ViewFilter filter) {
  if (filter == ViewFilter::Nearest) return plan_kernel::Numbers::NearestView;
  return filter == ViewFilter::Gauss ? plan_kernel::Numbers::Any : plan_kernel::Numbers::Clamped;
}

}  // namespace

ViewShape shape_of(const ViewSet& views) {
  return {.count = views.count(),
          .width = views.width(),
          .height = views.height(),
          .aspect = views.aspect()};
}

/// PlanBuilder builds parts of one plan; each thread has its own builder.
class PlanBuilder {
 public:
  PlanBuilder(WeavePlan& plan, const optics::OpticalModel& model, Isa isa)
      : plan_(plan),
        model_(model),
        rays_(model, isa),
        kernel_(LENTICULE_SELECT_KERNEL(isa, kPlanKernel)),
        terms_{.numbers = numbers_of(*plan.options_.filter),
               .views = plan.shape_.count,
               .view_step = plan.view_step_,
               .view_most = plan.view_most(),
               .off_border = plan.shape_.count * optics::kBorderTolerance},
        place_(place_picture(model.rig().panel, plan.shape_.aspect, plan.options_.fit)),
        picture_{.scale_u = place_.scale_u,
                 .scale_v = place_.scale_v,
                 .bars_beside = place_.bars_beside,
                 .bars_above = place_.bars_above,
                 .views = plan.shape_.count,
                 .width = plan.shape_.width} {}

  /// Returns the step from place to place in the panel's middle; all other steps differ little from
  /// it.
  [[nodiscard]] int32_t usual_step() {
    const optics::Panel& panel = model_.rig().panel;
    const int begin = std::max(0, panel.width_px / 2 - 32),
              end = std::min(panel.width_px, begin + 64);
    rays_.evaluate(panel.height_px / 2, begin, end, rows_[0]);
    Line& line = lines_[0];
    read_line(rows_[0], 0, line);
    std::vector<double> steps;
    for (size_t n = 1; n < static_cast<size_t>(line.places); ++n)
      if (line.lens[n] == line.lens[n - 1]) steps.push_back(line.view[n] - line.view[n - 1]);
    if (steps.empty()) return 0;
    const double step = upper_median(std::move(steps)) * kViewUnit;
    return std::abs(step) < (1 << 27) ? rounded(step) : 0;
  }

  void build(int first_block, int end_block, WeavePlan::Part& part) {
    const int segments = (plan_.geometry_.width + segment() - 1) / segment();
    sets_to_follow_ = static_cast<size_t>(end_block - first_block) * static_cast<size_t>(segments) *
                      plan_.stride_;
    for (int block = first_block; block < end_block; ++block) build_block(block, part);
  }

 private:
  /// Returns the subpixel of a place: every stride-th one, in stripes from red to blue.
  [[nodiscard]] size_t subpixel_of(uint32_t offset, size_t place) const {
    return plan_.blue_first_ ? place + 2 - 2 * (place % 3) : offset + place * plan_.stride_;
  }

  void read_line(const optics::RowRays& rays, uint32_t offset, Line& line) {
    const uint32_t stride = plan_.stride_;
    const size_t subpixels = rays.size();
    const size_t count = offset < subpixels ? (subpixels - offset + stride - 1) / stride : 0;
    line.resize(count);
    if (count == 0) return;
    plan_kernel::Places places{rays.lens_x_mm.data(), rays.lens_y_mm.data(), rays.place.data(),
                               line.places};
    if (stride == 1 && !plan_.blue_first_) {
      std::copy(rays.lens.begin(), rays.lens.end(), line.lens.begin());
    } else {
      const std::array<const std::vector<double>*, 3> from = {&rays.lens_x_mm, &rays.lens_y_mm,
                                                              &rays.place};
      for (size_t k = 0; k < from.size(); ++k) {
        places_[k].resize(count);
        for (size_t n = 0; n < count; ++n) places_[k][n] = (*from[k])[subpixel_of(offset, n)];
      }
      for (size_t n = 0; n < count; ++n) line.lens[n] = rays.lens[subpixel_of(offset, n)];
      places = {places_[0].data(), places_[1].data(), places_[2].data(), line.places};
    }
    kernel_.read_places(picture_, places, line.view.data(), line.column.data(), line.black.data());
    const double v = place_.v(places.lens_y_mm[count - 1]);
    const int height = plan_.shape_.height;
    line.row = std::clamp(v * height - 0.5, 0.0, height - 1.0);
  }

  /// Returns the pixels of a segment of a row.
  [[nodiscard]] int segment() const {
    const int columns = model_.rig().panel.layout.columns();
    return kSegmentPixels / columns * columns;
  }

  void build_block(int block, WeavePlan::Part& part) {
    const int step = segment();
    for (int i = 0; i < plan_.geometry_.width; i += step)
      build_segment(block, i, std::min(i + step, plan_.geometry_.width), part);
    part.blocks.push_back({part.sets.size(), part.bars.size()});
  }

  void build_segment(int block, int i_begin, int i_end, WeavePlan::Part& part) {
    const int rows = std::min(kRows, plan_.geometry_.height - block * kRows);
    for (int r = 0; r < rows; ++r)
      rays_.evaluate(block * kRows + r, i_begin, i_end, rows_[static_cast<size_t>(r)]);
    const auto subpixels = static_cast<uint32_t>(3 * (i_end - i_begin));
    for (uint32_t offset = 0; offset < std::min(plan_.stride_, subpixels); ++offset)
      build_set(rows, i_begin, offset, part);
  }

  void build_set(int rows, int i_begin, uint32_t offset, WeavePlan::Part& part) {
    sets_to_follow_ -= sets_to_follow_ > 0 ? 1 : 0;
    Set set{};
    set.first = static_cast<uint32_t>(3 * i_begin) + offset;
    set.stride = plan_.stride_;
    set.quads_begin = static_cast<uint32_t>(part.count);
    int top = plan_.shape_.height, bottom = 0;
    for (int r = 0; r < kRows; ++r) {
      const auto k = static_cast<size_t>(r);
      counts_[k] = 0;
      if (r < rows) {
        read_line(rows_[k], offset, lines_[k]);
        find_runs(k);
        note_bars(lines_[k], r, set, part);
      }
      const int row = rounded(lines_[r < rows ? k : 0].row * kColumnUnit);
      set.row[r] = row >> kWeightBits;
      set.row_share[r] = static_cast<int16_t>(row & ((1 << kWeightBits) - 1));
      top = std::min(top, set.row[r]);
      bottom = std::max(bottom, set.row[r] + 1);
    }
    join_rows(part);
    set.quads_end = static_cast<uint32_t>(part.count);
    part.sets.push_back(set);
    part.most_rows = std::max(part.most_rows, bottom - top + 1);
  }

  void note_bars(const Line& line, int r, const Set& set, WeavePlan::Part& part) const {
    const auto places = static_cast<size_t>(line.places);
    for (size_t begin = 0; begin < places;) {
      size_t end = begin;
      while (end < places && line.black[end] == line.black[begin]) ++end;
      if (line.black[begin] != 0)
        part.bars.push_back({r, set.first + static_cast<uint32_t>(begin) * set.stride, set.stride,
                             static_cast<uint32_t>(end - begin)});
      begin = end;
    }
  }

  void find_runs(size_t r) {
    runs_[r].resize(static_cast<size_t>(lines_[r].places));
    counts_[r] = kernel_.find_runs(terms_, lines_[r].terms(), runs_[r].data());
  }

  void join_rows(WeavePlan::Part& part) {
    const auto line = [&](size_t r) { return lines_[r].terms(); };
    // Most records have a run in each row, and the other sets of the part are like this one.
    const auto runs = static_cast<size_t>(counts_[0] + counts_[1] + counts_[2] + counts_[3]);
    part.make_room(runs, runs / kRows * sets_to_follow_);
    const int made =
        kernel_.join_runs(terms_, {line(0), line(1), line(2), line(3)},
                          {runs_[0].data(), runs_[1].data(), runs_[2].data(), runs_[3].data()},
                          {counts_[0], counts_[1], counts_[2], counts_[3]}, lines_[0].places,
                          part.quads() + part.count);
    LENTICULE_CHECK(made >= 0);
    part.count += static_cast<size_t>(made);
  }

  WeavePlan& plan_;
  const optics::OpticalModel& model_;
  optics::RowRayEvaluator rays_;
  const plan_kernel::Kernel& kernel_;
  plan_kernel::Terms terms_;
  PicturePlace place_;
  plan_kernel::Picture picture_;
  std::array<std::vector<double>, 3> places_;
  std::array<optics::RowRays, kRows> rows_;
  std::array<Line, kRows> lines_;
  std::array<std::vector<plan_kernel::Run>, kRows> runs_;
  std::array<int, kRows> counts_{};
  size_t sets_to_follow_ = 0;  ///< sets that the part lacks after the present one
};

void WeavePlan::Part::make_room(size_t records, size_t likely_to_follow) {
  const size_t needed = (count + records) * sizeof(Quad);
  if (needed <= memory.bytes()) return;
  // By half at least, so that sets that are larger than expected are not copied each time.
  LargeMemory larger(
      std::max(needed + likely_to_follow * sizeof(Quad), memory.bytes() + memory.bytes() / 2));
  if (count > 0) std::memcpy(larger.data(), memory.data(), count * sizeof(Quad));
  memory = std::move(larger);
}

WeavePlan::WeavePlan(const optics::OpticalModel& model, const ViewShape& shape,
                     const WeaveOptions& options, int threads, Isa isa)
    : shape_(shape), options_(options) {
  LENTICULE_CHECK(shape.count > 0 && shape.width > 0 && shape.height > 0 && threads > 0);
  if (shape.count > kMostPlannedViews)
    throw Error(
        ErrorKind::Usage,
        fmt::format("{} views: a weaving plan has at most {}", shape.count, kMostPlannedViews),
        "take every second view, or fewer");
  const optics::Rig& rig = model.rig();
  options_.filter = view_filter(options, rig.sheet, shape.count);
  geometry_ = {.width = rig.panel.width_px, .height = rig.panel.height_px};
  if (options_.filter == ViewFilter::Gauss) make_spot(rig.sheet.spot_sigma.value * shape.count);
  const auto& offsets = rig.sheet.channel_offset;
  const bool aligned = offsets[0] == offsets[1] && offsets[1] == offsets[2];
  const std::string& layout = rig.panel.layout.name();
  const bool stripes = aligned && (layout == "rgb" || layout == "bgr");
  blue_first_ = stripes && layout == "bgr";
  stride_ = stripes ? 1 : static_cast<uint32_t>(3 * rig.panel.layout.columns());
  view_step_ = PlanBuilder(*this, model, isa).usual_step();

  const int blocks = block_count();
  parts_.resize(static_cast<size_t>((blocks + kBlocksPerPart - 1) / kBlocksPerPart));
  const auto parts = static_cast<int>(parts_.size());
  WorkerThreads workers(std::min(threads, parts));
  std::vector<PlanBuilder> builders(static_cast<size_t>(workers.count()),
                                    PlanBuilder(*this, model, isa));
  workers.run(parts, [&](int part, int worker) {
    const int first = part * kBlocksPerPart;
    builders[static_cast<size_t>(worker)].build(first, std::min(first + kBlocksPerPart, blocks),
                                                parts_[static_cast<size_t>(part)]);
  });
  for (const Part& part : parts_) rows_of_block_ = std::max(rows_of_block_, part.most_rows);
}

/// Tables the weights of all views that the reference mixes, relative to the nearest view's, which
/// therefore never vanishes. `sigma` is in views.
void WeavePlan::make_spot(double sigma) {
  constexpr double kReach = 4.3;  // sigmas, as the reference
  constexpr double kSharpest = 1e-3;
  // Weights of wider spots change less from one fraction to the next.
  constexpr double kWide = 2.0;
  constexpr int kSharpBits = 15, kWideBits = 12;
  sigma = std::max(sigma, kSharpest);
  const int reach = std::min(static_cast<int>(kReach * sigma) + 1, shape_.count);
  const int taps = 2 * reach + 2, bits = sigma < kWide ? kSharpBits : kWideBits;
  const int fractions = 1 << bits;
  spot_weights_.reserve(static_cast<size_t>(fractions) * static_cast<size_t>(taps) + 8);
  for (int fraction = 0; fraction < fractions; ++fraction) {
    const double centre = (fraction + 0.5) / fractions, nearest = std::min(centre, 1.0 - centre);
    for (int n = 0; n < taps; ++n) {
      const double distance = n - reach - centre;
      const double weight =
          std::exp(-(distance * distance - nearest * nearest) / (2.0 * sigma * sigma));
      spot_weights_.push_back(static_cast<uint16_t>(std::lround(65535.0 * std::min(weight, 1.0))));
    }
  }
  spot_weights_.resize(spot_weights_.size() + 8);
  spot_ = {.weights = spot_weights_.data(),
           .taps = taps,
           .reach = reach,
           .bits = bits,
           .views = shape_.count};
}

int WeavePlan::block_count() const { return (geometry_.height + kRows - 1) / kRows; }

WeavePlan::Block WeavePlan::block(int index) const {
  const Part& part = parts_[static_cast<size_t>(index / kBlocksPerPart)];
  const auto at = static_cast<size_t>(index % kBlocksPerPart);
  const Part::Ends begin = at == 0 ? Part::Ends{0, 0} : part.blocks[at - 1];
  const Part::Ends end = part.blocks[at];
  return {.sets = std::span(part.sets).subspan(begin.sets, end.sets - begin.sets),
          .bars = std::span(part.bars).subspan(begin.bars, end.bars - begin.bars),
          .quads = part.quads()};
}

int32_t WeavePlan::view_most() const {
  const int32_t last = (shape_.count - 1) << kViewBits;
  return options_.filter == ViewFilter::Nearest ? last + (1 << kViewBits) - 1 : last;
}

size_t WeavePlan::memory_bytes() const {
  size_t bytes = spot_weights_.capacity() * sizeof(uint16_t);
  for (const Part& part : parts_)
    bytes += part.memory.bytes() + part.sets.capacity() * sizeof(Set) +
             part.bars.capacity() * sizeof(Bar);
  return bytes;
}

}  // namespace lenticule::frames
