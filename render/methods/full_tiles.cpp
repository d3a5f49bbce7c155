// SPDX-License-Identifier: Apache-2.0
#include "render/methods/full_tiles.h"

#include <algorithm>

#include "frames/linear_codes.h"
#include "render/accel/denormals.h"
#include "render/depth_budget/prefilter.h"
#include "render/shading/shading_tables.h"

namespace lenticule::render {
namespace {

/// Disables weak-ray skipping if rays are summed: the test is valid for one ray per subpixel only.
RenderOptions with_rays_that_add_up(RenderOptions options) {
  if (options.prefilter == Prefilter::Exhaustive) options.skip_weak_rays = false;
  return options;
}

std::vector<SubpixelPlace> places(const RenderOptions& options) {
  return options.prefilter == Prefilter::Exhaustive ? beam_samples(options.prefilter_samples)
                                                    : footprint_samples(options.samples);
}

}  // namespace

FullTiles::FullTiles(const optics::OpticalModel& model, const RenderOptions& options)
    : options_(with_rays_that_add_up(options)),
      plan_(model.rig()),
      packets_(model, plan_, options.isa),
      kernel_(shading_kernel_for(options.isa)) {
  for (const SubpixelPlace place : places(options)) samples_.emplace_back(model, place);
  if (options.prefilter == Prefilter::Depth || options.prefilter == Prefilter::Beam)
    prefilter_.emplace(model, plan_, options);
  if (options.zone) zone_.emplace(model, *options.zone, options.threads);
  if (zone_ && zone_->unseen() == 0) zone_.reset();
}

FullTiles::Worker::Worker(const FullTiles& tiles, const Scene& scene, const BeamTester& beams)
    : tiles_(tiles), scene_(scene), beams_(beams), maker_(tiles.packets_), tracer_(tiles.options_) {
  if (tiles.prefilter_) prefilter_.emplace(*tiles.prefilter_, scene);
}

FrameCounts FullTiles::Worker::counts() const {
  FrameCounts counts = tracer_.counts();
  if (prefilter_) counts += prefilter_->counts();
  counts.invalid_rays += refused_;
  counts.primary_rays += background_.filled();
  counts.primary_rays_culled += background_.filled();
  return counts;
}

void FullTiles::Worker::render(const Tile& tile, frames::WovenFrame& frame) {
  const FlushDenormals flush;
  WorkClock& clock = tracer_.clock();
  clock.turn_to(Work::MakeRays);
  light_.assign(static_cast<size_t>(tile.columns) * TilePlan::kRows, 0.0F);
  const double weight = 1.0 / static_cast<double>(tiles_.samples_.size());
  find_left_out(tile);
  DepthNotes* depths = prefilter_ ? &prefilter_->start(tile) : nullptr;
  for (size_t k = 0; k < tiles_.samples_.size(); ++k) {
    maker_.start(scene_, tile, tiles_.samples_[k]);
    // The prefilter compares subpixels with all their neighbours.
    trace(tile, {.number = static_cast<int>(k),
                 .weight = weight,
                 .depths = depths,
                 .left_out = prefilter_ ? std::span<const uint8_t>() : left_out_});
    refused_ += maker_.refused();  // found while packets are made
  }
  if (prefilter_) prefilter_->average(tile, maker_, light_, left_out_);
  clock.turn_to(Work::Write);
  write(tile, frame);
  clock.turn_to(Work::Idle);
}

/// Finds the columns that need not be traced. Others are traced as a whole, since the rays of a
/// packet are compared with each other to find holes.
void FullTiles::Worker::find_left_out(const Tile& tile) {
  if (!tiles_.zone_) return;
  left_out_.resize(static_cast<size_t>(tile.columns));
  for (int column = 0; column < tile.columns; ++column)
    left_out_[static_cast<size_t>(column)] =
        tiles_.zone_->hides(tiles_.plan_, tile, column) ? 1 : 0;
}

void FullTiles::Worker::trace(const Tile& tile, PacketTracer::FootprintSample sample) {
  const auto trace_columns = [&](ColumnRange columns) {
    tracer_.trace(scene_, tiles_.plan_, tile, columns, sample, maker_, light_);
  };
  if (!tiles_.options_.skip_background) return trace_columns({0, tile.columns});
  for (const Background::Run& run : background_.runs(beams_, maker_)) {
    if (!run.empty)
      trace_columns(run.columns);
    else
      background_.fill(scene_, tiles_.plan_, tile, run.columns, sample.weight, maker_, light_);
  }
}

void FullTiles::Worker::write(const Tile& tile, frames::WovenFrame& frame) const {
  const shading_kernel::Kernel& kernel = tiles_.kernel_;
  for (int row = 0; row < tile.rows; ++row) {
    // Subpixel 3 i + channel is byte 3 i + channel of the row.
    const int first = tiles_.plan_.subpixel(tile, 0, row);
    const int begin = std::max(0, -first);
    const int end = std::min(tile.columns, tiles_.plan_.row_subpixels() - first);
    const float* in = light_.data() + static_cast<size_t>(row) * tile.columns;
    if (begin >= end) continue;
    uint8_t* codes = frame.row(tile.row_begin + row);
    if (scene_.colour_managed)
      kernel.encode_linear(frames::linear_codes(), in + begin, end - begin, codes + first + begin);
    else
      kernel.encode(in + begin, end - begin, codes + first + begin);
    if (tiles_.zone_)
      tiles_.zone_->for_each_unseen(tile.row_begin + row, static_cast<size_t>(first + begin),
                                    static_cast<size_t>(first + end),
                                    [codes](size_t at) { codes[at] = 0; });
  }
}

}  // namespace lenticule::render
