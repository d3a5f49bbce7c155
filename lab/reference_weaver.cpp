// SPDX-License-Identifier: Apache-2.0
#include "lab/reference_weaver.h"

#include <algorithm>
#include <vector>

#include "frames/srgb.h"
#include "optics/row_rays.h"

namespace lenticule::lab {
namespace {

using frames::PicturePlace;
using frames::ViewSet;

/// Returns the linear light of a channel of a view at (u, v), fractions from the left and from the
/// top. Pixel centres lie at half-integers. Beyond the outermost centres the border pixel is
/// repeated, so that no tile bleeds into its neighbour.
double light_at(const ViewSet& views, int view, double u, double v, int channel) {
  const double x = std::clamp(u * views.width() - 0.5, 0.0, views.width() - 1.0);
  const double y = std::clamp(v * views.height() - 0.5, 0.0, views.height() - 1.0);
  const int left = static_cast<int>(x), top = static_cast<int>(y);
  const int right = std::min(left + 1, views.width() - 1);
  const int bottom = std::min(top + 1, views.height() - 1);
  const double share_right = x - left, share_bottom = y - top;
  const auto& light = frames::linear_of_codes();
  const auto tap = [&](int column, int row) {
    return light[views.pixel(view, column, row)[channel]];
  };
  const double upper = tap(left, top) * (1.0 - share_right) + tap(right, top) * share_right;
  const double lower = tap(left, bottom) * (1.0 - share_right) + tap(right, bottom) * share_right;
  return upper * (1.0 - share_bottom) + lower * share_bottom;
}

}  // namespace

void weave_rows(const ViewSet& views, const optics::OpticalModel& model,
                const frames::WeaveOptions& options, int begin, int end,
                frames::WovenFrame& frame) {
  const optics::Rig& rig = model.rig();
  const int count = views.count();
  const frames::ViewFilter filter = frames::view_filter(options, rig.sheet, count);
  const PicturePlace place = frames::place_picture(rig.panel, views.aspect(), options.fit);
  const optics::RowRayEvaluator evaluator(model);
  optics::RowRays rays;
  std::vector<double> weights;
  for (int j = begin; j < end; ++j) {
    evaluator.evaluate(j, 0, frame.width(), rays);
    for (size_t s = 0; s < frame.geometry().row_bytes(); ++s) {
      const double u = place.u(rays.lens_x_mm[s]), v = place.v(rays.lens_y_mm[s]);
      double light = 0.0;
      const int first = frames::view_weights(optics::view_number(rays.place[s], count), count,
                                             filter, rig.sheet.spot_sigma.value * count, weights);
      for (size_t w = 0; w < weights.size(); ++w) {
        const int view = first + static_cast<int>(w);
        const bool reversed = options.order == frames::ViewOrder::RightToLeft;
        light += weights[w] *
                 light_at(views, reversed ? count - 1 - view : view, u, v, static_cast<int>(s % 3));
      }
      // On sides without a bar, a lens point slightly outside the panel shows the view's border.
      const bool in_bars = (place.bars_beside && !(u >= 0.0 && u < 1.0)) ||
                           (place.bars_above && !(v >= 0.0 && v < 1.0));
      frame.row(j)[s] = in_bars ? 0 : frames::code_from_linear(light);
    }
  }
}

frames::WovenFrame weave(const ViewSet& views, const optics::OpticalModel& model,
                         const frames::WeaveOptions& options) {
  const optics::Panel& panel = model.rig().panel;
  frames::WovenFrame frame({.width = panel.width_px, .height = panel.height_px});
  weave_rows(views, model, options, 0, frame.height(), frame);
  return frame;
}

}  // namespace lenticule::lab
