// SPDX-License-Identifier: Apache-2.0
#include "render/rays/zone_mask.h"

#include <oneapi/tbb/blocked_range.h>
#include <oneapi/tbb/parallel_for.h>
#include <oneapi/tbb/task_arena.h>

#include <algorithm>
#include <numeric>

namespace lenticule::render {

ZoneMask::ZoneMask(const optics::OpticalModel& model, const optics::ViewingZone& zone,
                   int threads) {
  const optics::ZoneVisibility visibility(model, zone);
  const int rows = model.rig().panel.height_px;
  words_per_row_ = (3 * static_cast<size_t>(model.rig().panel.width_px) + kBits - 1) / kBits;
  words_.resize(words_per_row_ * static_cast<size_t>(rows));
  unseen_.resize(static_cast<size_t>(rows));
  tbb::task_arena arena(threads > 0 ? threads : tbb::task_arena::automatic);
  arena.execute([&] {
    tbb::parallel_for(tbb::blocked_range<int>(0, rows), [&](const tbb::blocked_range<int>& some) {
      optics::ZoneVisibility::Row row;
      for (int j = some.begin(); j < some.end(); ++j) {
        visibility.evaluate(j, row);
        uint64_t* words = words_.data() + static_cast<size_t>(j) * words_per_row_;
        for (size_t at = 0; at < row.seen.size(); ++at)
          words[at / kBits] |= uint64_t{row.seen[at] == 0} << at % kBits;
        unseen_[static_cast<size_t>(j)] =
            static_cast<uint32_t>(std::ranges::count(row.seen, uint8_t{0}));
      }
    });
  });
}

bool ZoneMask::hides(const TilePlan& plan, const Tile& tile, int column) const {
  for (int row = 0; row < tile.rows; ++row) {
    const int at = plan.subpixel(tile, column, row);
    if (at >= 0 && at < plan.row_subpixels() && seen(tile.row_begin + row, static_cast<size_t>(at)))
      return false;
  }
  return true;
}

uint64_t ZoneMask::unseen() const {
  return std::accumulate(unseen_.begin(), unseen_.end(), uint64_t{0});
}

}  // namespace lenticule::render
