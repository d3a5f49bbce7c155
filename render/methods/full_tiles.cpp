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
  DepthNotes* depths = prefilter_ ? &prefilter_->start(tile) : nullptr;
  for (size_t k = 0; k < tiles_.samples_.size(); ++k) {
    maker_.start(scene_, tile, tiles_.samples_[k]);
    trace(tile, {.number = static_cast<int>(k), .weight = weight, .depths = depths});
    refused_ += maker_.refused();  // found while packets are made
  }
  if (prefilter_) prefilter_->average(tile, maker_, light_);
  clock.turn_to(Work::Write);
  write(tile, frame);
  clock.turn_to(Work::Idle);
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
  }
}

}  // namespace lenticule::render
