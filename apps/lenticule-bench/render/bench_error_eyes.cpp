// SPDX-License-Identifier: Apache-2.0
#include "apps/lenticule-bench/render/bench_error_eyes.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <optional>

#include "frames/decoded_view.h"
#include "frames/similarity.h"

namespace lenticule::bench {

double seen_pixels_per_degree(const optics::Rig& rig) {
  const double distance_mm = rig.viewing.distance.value;
  if (std::isinf(distance_mm)) return frames::kFlipPixelsPerDegree;
  const double width_mm = rig.panel.width_px * rig.panel.pixel_width.value;
  const double pixel_mm = width_mm / frames::decoded_geometry(rig).width;
  return std::clamp(distance_mm / pixel_mm * std::numbers::pi / 180.0, 1.0, 1000.0);
}

ErrorEyes::ErrorEyes(const optics::OpticalModel& model, frames::BandWorkers& workers)
    : model_(model), workers_(workers), pixels_per_degree_(seen_pixels_per_degree(model.rig())) {}

frames::WovenFrame ErrorEyes::seen(const frames::FrameView& woven, int eye) const {
  return frames::decode_view(woven, model_, eye, kErrorEyes);
}

void ErrorEyes::set_reference(const frames::FrameView& woven) {
  std::array<std::optional<frames::FlipPicture>, kErrorEyes> flip;
  workers_.run(kErrorEyes, [&](int eye, int) {
    const auto e = static_cast<size_t>(eye);
    reference_[e] = seen(woven, eye);
    flip[e].emplace(reference_[e].view(), pixels_per_degree_);
  });
  reference_flip_.clear();
  for (auto& picture : flip) reference_flip_.push_back(std::move(*picture));
}

nlohmann::json ErrorEyes::compare(const frames::FrameView& woven, EyeFlicker& flicker) {
  std::array<nlohmann::json, kErrorEyes> figures;
  workers_.run(kErrorEyes, [&](int eye, int) {
    const auto e = static_cast<size_t>(eye);
    test_[e] = seen(woven, eye);
    const frames::FrameView a = reference_[e].view();
    const frames::FrameView b = test_[e].view();
    const frames::FlipFigures flip = frames::flip_figures(
        frames::flip_map(reference_flip_[e], frames::FlipPicture(b, pixels_per_degree_)));
    const frames::Flicker change = flicker[e].add(a, b);
    figures[e] = {{"ssim", nullptr},
                  {"flip_mean", flip.mean},
                  {"flip_p99", flip.percentile_99},
                  {"flicker_mean", change.mean},
                  {"flicker_largest", change.largest}};
    if (const auto ssim = frames::structural_similarity(a, b)) figures[e]["ssim"] = *ssim;
  });
  return figures;
}

}  // namespace lenticule::bench
