// SPDX-License-Identifier: Apache-2.0
#include "frames/weaving/weave_plan.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <atomic>
#include <cmath>
#include <limits>
#include <thread>

#include "base/error.h"
#include "base/statistics.h"
#include "optics/row_rays.h"

namespace lenticule::frames {

using weave_kernel::kRows;
using weave_kernel::kRun;
using weave_kernel::kSlopeBits;
using weave_kernel::kViewBits;
using weave_kernel::kWeightBits;
using weave_kernel::Quad;
using weave_kernel::Set;

namespace {

constexpr int kBlocksPerPart = 16;
/// Places of a set have 16 bits; the segment is the largest multiple of the layout's columns below
/// this limit.
constexpr int kSegmentPixels = 16384;
constexpr double kViewUnit = 1 << kViewBits;
constexpr double kColumnUnit = 1 << kWeightBits;
/// Largest distance of a run from the rays, in the run's own units.
constexpr double kViewTolerance = 32.0;
constexpr double kColumnTolerance = 3.0;
/// The movement of a column along a run, before it is shifted down, stays within 16 bits.
constexpr int kFurthestColumn = 32767;

/// Line holds the places of one row of a set, as the rays give them.
struct Line {
  std::vector<double> view;    ///< numbers, in (0, views]
  std::vector<double> column;  ///< picture pixels from the first one's centre, within the picture
  std::vector<int32_t> lens;
  std::vector<uint8_t> black;
  double row = 0.0;

  void resize(size_t places) {
    view.resize(places);
    column.resize(places);
    lens.resize(places);
    black.resize(places);
  }
};

/// Run is a run before it shares its steps with other rows. Steps are per place, in kernel units.
struct Run {
  int at = 0;
  int count = 0;
  int32_t lens = 0;
  int32_t view = 0;
  int column = 0;
  int share = 0;
  double view_step = 0.0;
  double column_step = 0.0;
  double column_bend = 0.0;
};

/// Steps holds the integer values that the runs of a record share.
struct Steps {
  int view = 0;
  int bend = 0;
};

int rounded(double value) {
  return static_cast<int>(std::lround(value));
}

bool is_short(double value) {
  return std::abs(value) <= std::numeric_limits<int16_t>::max();
}

/// Returns the column step such that the run ends where its own parabola does, despite a slightly
/// different bend.
int column_step_of(const Run& run, int bend) {
  return rounded(run.column_step + (run.column_bend - bend) * (run.count - 1));
}

/// Fits the parabola through a run's first, middle and last column.
void bend_column(const Line& line, Run& run) {
  const auto column = [&](int n) {
    const auto first = static_cast<size_t>(run.at);
    return (line.column[first + static_cast<size_t>(n)] - line.column[first]) * kColumnUnit *
           (1 << kSlopeBits);
  };
  const int last = run.count - 1, middle = last / 2;
  const double mean = column(last) / last;
  if (middle > 0) run.column_bend = (mean - column(middle) / middle) / (last - middle);
  run.column_step = mean - run.column_bend * last;
}

}  // namespace

ViewShape shape_of(const ViewSet& views) {
  return {.count = views.count(),
          .width = views.width(),
          .height = views.height(),
          .aspect = views.aspect()};
}

/// PlanBuilder builds the parts of one plan; each thread has its own builder.
class PlanBuilder {
 public:
  PlanBuilder(WeavePlan& plan, const optics::OpticalModel& model)
      : plan_(plan),
        model_(model),
        rays_(model),
        place_(place_picture(model.rig().panel, plan.shape_.aspect, plan.options_.fit)) {}

  /// Returns the step from place to place in the panel's middle; all other steps differ little from
  /// it.
  [[nodiscard]] int32_t usual_step();
  void build(int first_block, int end_block, WeavePlan::Part& part);
  [[nodiscard]] int most_rows() const { return most_rows_; }

 private:
  using Runs = std::array<std::vector<Run>, kRows>;

  void read_line(const optics::RowRays& rays, uint32_t offset, Line& line) const;
  void build_block(int block, WeavePlan::Part& part);
  void build_segment(int block, int i_begin, int i_end, WeavePlan::Part& part);
  void build_set(int rows, int i_begin, uint32_t offset, WeavePlan::Part& part);
  void note_bars(const Line& line, int r, const Set& set, WeavePlan::Part& part) const;
  void find_runs(const Line& line, std::vector<Run>& runs) const;
  [[nodiscard]] Run longest_run(const Line& line, int at) const;
  [[nodiscard]] Run run_of(const Line& line, int at, int count) const;
  [[nodiscard]] int32_t view_of(double number) const;
  [[nodiscard]] bool view_fits(int64_t view, double number) const;
  [[nodiscard]] bool fits(const Line& line, const Run& run, const Steps& steps) const;
  [[nodiscard]] Steps shared_steps(const std::array<const Run*, kRows>& rows) const;
  void join_rows(const Runs& runs, int places, WeavePlan::Part& part) const;
  [[nodiscard]] bool join(const std::array<const Run*, kRows>& rows, int places,
                          WeavePlan::Part& part) const;

  WeavePlan& plan_;
  const optics::OpticalModel& model_;
  optics::RowRayEvaluator rays_;
  PicturePlace place_;
  std::array<optics::RowRays, kRows> rows_;
  std::array<Line, kRows> lines_;
  Runs runs_;
  int most_rows_ = 2;
};

int32_t PlanBuilder::usual_step() {
  const optics::Panel& panel = model_.rig().panel;
  const int begin = std::max(0, panel.width_px / 2 - 32),
            end = std::min(panel.width_px, begin + 64);
  rays_.evaluate(panel.height_px / 2, begin, end, rows_[0]);
  Line& line = lines_[0];
  read_line(rows_[0], 0, line);
  std::vector<double> steps;
  for (size_t n = 1; n < line.view.size(); ++n)
    if (line.lens[n] == line.lens[n - 1]) steps.push_back(line.view[n] - line.view[n - 1]);
  if (steps.empty()) return 0;
  const double step = upper_median(std::move(steps)) * kViewUnit;
  return std::abs(step) < (1 << 27) ? rounded(step) : 0;
}

void PlanBuilder::read_line(const optics::RowRays& rays, uint32_t offset, Line& line) const {
  const uint32_t stride = plan_.stride_;
  const ViewShape& shape = plan_.shape_;
  const size_t subpixels = rays.size();
  line.resize(offset < subpixels ? (subpixels - offset + stride - 1) / stride : 0);
  for (size_t n = 0; n < line.view.size(); ++n) {
    size_t s = offset + n * stride;
    if (plan_.blue_first_) s += 2 - 2 * (s % 3);
    const double u = place_.u(rays.lens_x_mm[s]), v = place_.v(rays.lens_y_mm[s]);
    line.black[n] = place_.in_bars(u, v) ? 1 : 0;
    line.view[n] = optics::view_number(rays.place[s], shape.count);
    line.column[n] = std::clamp(u * shape.width - 0.5, 0.0, shape.width - 1.0);
    line.lens[n] = rays.lens[s];
    line.row = std::clamp(v * shape.height - 0.5, 0.0, shape.height - 1.0);
  }
}

/// Returns the view number in kernel units.
int32_t PlanBuilder::view_of(double number) const {
  if (plan_.options_.filter == ViewFilter::Nearest) {
    const double off_border = plan_.shape_.count * optics::kBorderTolerance;
    return rounded((number - off_border) * kViewUnit) - 1;
  }
  return rounded((number - 0.5) * kViewUnit);
}

bool PlanBuilder::view_fits(int64_t view, double number) const {
  const int views = plan_.shape_.count;
  const auto held = std::clamp<int64_t>(view, 0, plan_.view_most());
  if (plan_.options_.filter == ViewFilter::Nearest)
    return static_cast<int>(held >> kViewBits) == nearest_view(number, views);
  if (plan_.options_.filter == ViewFilter::Gauss)
    return std::abs(static_cast<double>(view) - (number - 0.5) * kViewUnit) <= kViewTolerance;
  const double wanted = std::clamp(number - 0.5, 0.0, views - 1.0);
  return std::abs(static_cast<double>(held) - wanted * kViewUnit) <= kViewTolerance;
}

bool PlanBuilder::fits(const Line& line, const Run& run, const Steps& steps) const {
  if (!is_short(steps.view - plan_.view_step_) || !is_short(steps.bend)) return false;
  const int column_step = column_step_of(run, steps.bend);
  if (!is_short(column_step)) return false;
  for (int n = 0; n < run.count; ++n) {
    const auto s = static_cast<size_t>(run.at + n);
    if (!view_fits(run.view + int64_t{n} * steps.view, line.view[s])) return false;
    const int step = column_step + n * steps.bend;
    if (std::abs(step) > kFurthestColumn || std::abs(n * step) > kFurthestColumn) return false;
    const int share = run.share + ((n * step) >> kSlopeBits);
    if (share < 0 || share >= (1 << kWeightBits)) return false;
    const double off = run.column * kColumnUnit + share - line.column[s] * kColumnUnit;
    if (std::abs(off) > kColumnTolerance) return false;
  }
  return true;
}

Run PlanBuilder::run_of(const Line& line, int at, int count) const {
  const auto first = static_cast<size_t>(at), last = first + static_cast<size_t>(count - 1);
  const int column = rounded(line.column[first] * kColumnUnit);
  Run run{.at = at,
          .count = count,
          .lens = line.lens[first],
          .view = view_of(line.view[first]),
          .column = column >> kWeightBits,
          .share = column & ((1 << kWeightBits) - 1),
          .view_step = static_cast<double>(plan_.view_step_)};
  if (count > 1) {
    run.view_step = (line.view[last] - line.view[first]) * kViewUnit / (count - 1);
    bend_column(line, run);
  }
  return run;
}

/// Returns the longest run from `at` on. One place always fits; only a view that rounding put over
/// a border is moved.
Run PlanBuilder::longest_run(const Line& line, int at) const {
  const auto first = static_cast<size_t>(at);
  int count = 1;
  while (count < kRun && first + static_cast<size_t>(count) < line.view.size() &&
         line.lens[first + static_cast<size_t>(count)] == line.lens[first] &&
         line.black[first + static_cast<size_t>(count)] == 0)
    ++count;
  for (; count > 1; --count) {
    const Run run = run_of(line, at, count);
    if (!is_short(run.view_step - plan_.view_step_) || !is_short(run.column_step) ||
        !is_short(run.column_bend))
      continue;
    if (fits(line, run, {rounded(run.view_step), rounded(run.column_bend)})) return run;
  }
  Run run = run_of(line, at, 1);
  if (!view_fits(run.view, line.view[first]))
    run.view = nearest_view(line.view[first], plan_.shape_.count) << kViewBits;
  return run;
}

void PlanBuilder::find_runs(const Line& line, std::vector<Run>& runs) const {
  runs.clear();
  const int places = static_cast<int>(line.view.size());
  for (int at = 0; at < places;) {
    if (line.black[static_cast<size_t>(at)] != 0) {
      ++at;
      continue;
    }
    runs.push_back(longest_run(line, at));
    at += runs.back().count;
  }
}

void PlanBuilder::note_bars(const Line& line, int r, const Set& set, WeavePlan::Part& part) const {
  const size_t places = line.black.size();
  for (size_t begin = 0; begin < places;) {
    size_t end = begin;
    while (end < places && line.black[end] == line.black[begin]) ++end;
    if (line.black[begin] != 0)
      part.bars.push_back({r, set.first + static_cast<uint32_t>(begin) * set.stride, set.stride,
                           static_cast<uint32_t>(end - begin)});
    begin = end;
  }
}

Steps PlanBuilder::shared_steps(const std::array<const Run*, kRows>& rows) const {
  double view = 0.0, bend = 0.0;
  int several = 0;
  for (const Run* run : rows) {
    if (run == nullptr || run->count < 2) continue;
    view += run->view_step;
    bend += run->column_bend;
    ++several;
  }
  if (several == 0) return {.view = plan_.view_step_, .bend = 0};
  return {rounded(view / several), rounded(bend / several)};
}

/// Makes one record of the rows' runs if they can share their steps.
bool PlanBuilder::join(const std::array<const Run*, kRows>& rows, int places,
                       WeavePlan::Part& part) const {
  const Steps steps = shared_steps(rows);
  int column = 0;
  for (const Run* run : rows)
    if (run != nullptr) column = run->column;
  Quad quad{};
  quad.view_step = static_cast<int16_t>(steps.view - plan_.view_step_);
  quad.column_bend = static_cast<int16_t>(steps.bend);
  for (size_t r = 0; r < kRows; ++r) {
    quad.at[r] = static_cast<uint16_t>(places);
    quad.column[r] = static_cast<uint16_t>(column);
    const Run* run = rows[r];
    if (run == nullptr) continue;
    if (!fits(lines_[r], *run, steps)) return false;
    quad.view[r] = run->view;
    quad.share[r] = static_cast<uint16_t>(run->share);
    quad.column[r] = static_cast<uint16_t>(run->column);
    quad.at[r] = static_cast<uint16_t>(run->at);
    quad.column_step[r] = static_cast<int16_t>(column_step_of(*run, steps.bend));
    quad.counts = static_cast<uint16_t>(quad.counts | run->count << (4 * r));
  }
  for (int r = 0; r < kRows; ++r)
    quad.colours = static_cast<uint16_t>(quad.colours | quad.at[r] % 3 << (2 * r));
  part.quads.push_back(quad);
  return true;
}

/// Joins the rows' runs of one lens to a record, from the left to the right.
void PlanBuilder::join_rows(const Runs& runs, int places, WeavePlan::Part& part) const {
  std::array<size_t, kRows> next{};
  while (true) {
    bool any = false;
    int32_t lens = 0;
    for (size_t r = 0; r < kRows; ++r) {
      if (next[r] == runs[r].size()) continue;
      const int32_t here = runs[r][next[r]].lens;
      lens = any ? std::min(lens, here) : here;
      any = true;
    }
    if (!any) return;
    std::array<const Run*, kRows> rows{};
    for (size_t r = 0; r < kRows; ++r)
      if (next[r] < runs[r].size() && runs[r][next[r]].lens == lens) rows[r] = &runs[r][next[r]++];
    if (join(rows, places, part)) continue;
    for (size_t r = 0; r < kRows; ++r) {
      std::array<const Run*, kRows> alone{};
      alone[r] = rows[r];
      if (rows[r] != nullptr) LENTICULE_CHECK(join(alone, places, part));
    }
  }
}

void PlanBuilder::build_set(int rows, int i_begin, uint32_t offset, WeavePlan::Part& part) {
  Set set{};
  set.first = static_cast<uint32_t>(3 * i_begin) + offset;
  set.stride = plan_.stride_;
  set.quads_begin = static_cast<uint32_t>(part.quads.size());
  int top = plan_.shape_.height, bottom = 0;
  for (int r = 0; r < kRows; ++r) {
    const auto k = static_cast<size_t>(r);
    runs_[k].clear();
    if (r < rows) {
      read_line(rows_[k], offset, lines_[k]);
      find_runs(lines_[k], runs_[k]);
      note_bars(lines_[k], r, set, part);
    }
    const int row = rounded(lines_[r < rows ? k : 0].row * kColumnUnit);
    set.row[r] = row >> kWeightBits;
    set.row_share[r] = static_cast<int16_t>(row & ((1 << kWeightBits) - 1));
    top = std::min(top, set.row[r]);
    bottom = std::max(bottom, set.row[r] + 1);
  }
  join_rows(runs_, static_cast<int>(lines_[0].view.size()), part);
  set.quads_end = static_cast<uint32_t>(part.quads.size());
  part.sets.push_back(set);
  most_rows_ = std::max(most_rows_, bottom - top + 1);
}

void PlanBuilder::build_segment(int block, int i_begin, int i_end, WeavePlan::Part& part) {
  const int rows = std::min(kRows, plan_.geometry_.height - block * kRows);
  for (int r = 0; r < rows; ++r)
    rays_.evaluate(block * kRows + r, i_begin, i_end, rows_[static_cast<size_t>(r)]);
  const auto subpixels = static_cast<uint32_t>(3 * (i_end - i_begin));
  for (uint32_t offset = 0; offset < std::min(plan_.stride_, subpixels); ++offset)
    build_set(rows, i_begin, offset, part);
}

void PlanBuilder::build_block(int block, WeavePlan::Part& part) {
  const int columns = model_.rig().panel.layout.columns();
  const int step = kSegmentPixels / columns * columns;
  for (int i = 0; i < plan_.geometry_.width; i += step)
    build_segment(block, i, std::min(i + step, plan_.geometry_.width), part);
  part.blocks.push_back({part.sets.size(), part.bars.size()});
}

void PlanBuilder::build(int first_block, int end_block, WeavePlan::Part& part) {
  for (int block = first_block; block < end_block; ++block) build_block(block, part);
  part.quads.shrink_to_fit();
}

WeavePlan::WeavePlan(const optics::OpticalModel& model, const ViewShape& shape,
                     const WeaveOptions& options, int threads)
    : shape_(shape), options_(options) {
  LENTICULE_CHECK(shape.count > 0 && shape.width > 0 && shape.height > 0 && threads > 0);
  if (shape.count > kMostPlannedViews)
    throw Error(
        ErrorKind::Usage,
        fmt::format("{} views: a weaving plan has at most {}", shape.count, kMostPlannedViews),
        "use --reference for more");
  const optics::Rig& rig = model.rig();
  geometry_ = {.width = rig.panel.width_px, .height = rig.panel.height_px};
  spot_sigma_ = rig.sheet.spot_sigma.value * shape.count;
  const auto& offsets = rig.sheet.channel_offset;
  const bool aligned = offsets[0] == offsets[1] && offsets[1] == offsets[2];
  const std::string& layout = rig.panel.layout.name();
  const bool stripes = aligned && (layout == "rgb" || layout == "bgr");
  blue_first_ = stripes && layout == "bgr";
  stride_ = stripes ? 1 : static_cast<uint32_t>(3 * rig.panel.layout.columns());
  view_step_ = PlanBuilder(*this, model).usual_step();

  const int blocks = block_count();
  parts_.resize(static_cast<size_t>((blocks + kBlocksPerPart - 1) / kBlocksPerPart));
  std::atomic<size_t> next{0};
  std::atomic<int> most_rows{2};
  const auto work = [&] {
    PlanBuilder builder(*this, model);
    for (size_t part = next++; part < parts_.size(); part = next++) {
      const int first = static_cast<int>(part) * kBlocksPerPart;
      builder.build(first, std::min(first + kBlocksPerPart, blocks), parts_[part]);
    }
    int seen = most_rows.load();
    while (seen < builder.most_rows() &&
           !most_rows.compare_exchange_weak(seen, builder.most_rows())) {
    }
  };
  {
    std::vector<std::jthread> helpers;
    for (int n = 1; n < threads; ++n) helpers.emplace_back(work);
    work();
  }
  rows_of_block_ = most_rows;
}

int WeavePlan::block_count() const {
  return (geometry_.height + kRows - 1) / kRows;
}

WeavePlan::Block WeavePlan::block(int index) const {
  const Part& part = parts_[static_cast<size_t>(index / kBlocksPerPart)];
  const auto at = static_cast<size_t>(index % kBlocksPerPart);
  const Part::Ends begin = at == 0 ? Part::Ends{0, 0} : part.blocks[at - 1];
  const Part::Ends end = part.blocks[at];
  return {.sets = std::span(part.sets).subspan(begin.sets, end.sets - begin.sets),
          .bars = std::span(part.bars).subspan(begin.bars, end.bars - begin.bars),
          .quads = part.quads.data()};
}

int32_t WeavePlan::view_most() const {
  const int32_t last = (shape_.count - 1) << kViewBits;
  return options_.filter == ViewFilter::Nearest ? last + (1 << kViewBits) - 1 : last;
}

size_t WeavePlan::memory_bytes() const {
  size_t bytes = 0;
  for (const Part& part : parts_)
    bytes += part.quads.capacity() * sizeof(Quad) + part.sets.capacity() * sizeof(Set) +
             part.bars.capacity() * sizeof(Bar);
  return bytes;
}

}  // namespace lenticule::frames
