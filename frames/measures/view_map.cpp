// SPDX-License-Identifier: Apache-2.0
#include "frames/measures/view_map.h"

#include <fmt/format.h>

#include <algorithm>

#include "base/error.h"
#include "frames/quilt.h"
#include "frames/weave.h"
#include "optics/row_rays.h"

namespace lenticule::frames {
namespace {

/// Enough bands for any number of threads, but few enough for long runs of rows.
constexpr int kBands = 64;

struct Rows {
  int begin;
  int end;
};

Rows rows_of(int band, int height) {
  const auto border = [height](int b) { return static_cast<int>(int64_t{height} * b / kBands); };
  return {border(band), border(band + 1)};
}

}  // namespace

ViewMap::ViewMap(const optics::OpticalModel& model, int views, BandWorkers& workers)
    : geometry_{model.rig().panel.width_px, model.rig().panel.height_px, PixelFormat::Rgb8},
      views_(views),
      view_(geometry_.frame_bytes()) {
  if (views < 1 || views > kMaxViews)
    throw Error(ErrorKind::Usage, fmt::format("{} views: not in 1 ... {}", views, kMaxViews));
  const optics::RowRayEvaluator evaluator(model);
  std::vector<optics::RowRays> rays(static_cast<size_t>(workers.count()));
  workers.run(kBands, [&](int band, int worker) {
    optics::RowRays& row = rays[static_cast<size_t>(worker)];
    const Rows rows = rows_of(band, geometry_.height);
    for (int j = rows.begin; j < rows.end; ++j) {
      evaluator.evaluate(j, 0, geometry_.width, row);
      uint16_t* const out = view_.data() + static_cast<size_t>(j) * geometry_.row_bytes();
      for (size_t s = 0; s < row.size(); ++s)
        out[s] =
            static_cast<uint16_t>(nearest_view(optics::view_number(row.place[s], views), views));
    }
  });
}

std::vector<Difference> ViewMap::compare(const FrameView& reference, const FrameView& test,
                                         BandWorkers& workers) const {
  require_same_size(reference, test);
  require_same_size({geometry_, {}}, test);
  const auto views = static_cast<size_t>(views_);
  std::vector<std::vector<Difference>> found(static_cast<size_t>(workers.count()),
                                             std::vector<Difference>(views));
  workers.run(kBands, [&](int band, int worker) {
    std::vector<Difference>& differences = found[static_cast<size_t>(worker)];
    const Rows rows = rows_of(band, geometry_.height);
    const size_t begin = static_cast<size_t>(rows.begin) * geometry_.row_bytes();
    const size_t end = static_cast<size_t>(rows.end) * geometry_.row_bytes();
    for (size_t s = begin; s < end; ++s)
      differences[view_[s]].add(reference.bytes[s], test.bytes[s]);
  });
  for (size_t worker = 1; worker < found.size(); ++worker)
    for (size_t view = 0; view < views; ++view) found[0][view].add(found[worker][view]);
  return std::move(found[0]);
}

}  // namespace lenticule::frames
