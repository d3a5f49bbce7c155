// SPDX-License-Identifier: Apache-2.0
#include "frames/weaving/reweave.h"

#include <algorithm>
#include <cmath>
#include <utility>
#include <vector>

#include "frames/decoded_view.h"
#include "optics/error.h"

namespace lenticule::frames {

int views_in_woven(const optics::Rig& rig) {
  return std::clamp(static_cast<int>(std::lround(rig.sheet.pitch.value)), 2, kMaxViews);
}

ViewSet views_of_woven(const FrameView& woven, const optics::OpticalModel& model, int views) {
  LENTICULE_CHECK(views > 0);
  const optics::Panel& panel = model.rig().panel;
  std::vector<WovenFrame> pictures;
  for (int view = 0; view < views; ++view)
    pictures.push_back(decode_view(woven, model, view, views));
  return ViewSet(std::move(pictures), panel.width_px * panel.pixel_width.value /
                                          (panel.height_px * panel.pixel_height.value));
}

}  // namespace lenticule::frames
