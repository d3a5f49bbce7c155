// SPDX-License-Identifier: Apache-2.0
// Weaving is defined here: filters, the place of views on the panel and their weights; and the way
// back, from a woven frame to its views. FastWeaver weaves.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "frames/frame.h"
#include "frames/quilt.h"
#include "optics/eye_simulator.h"
#include "optics/model.h"

namespace lenticule::frames {

/// ViewFilter selects the contribution of the views beside a subpixel's view number v. View k spans
/// (k, k + 1] and has its centre at k + 1/2. Filters never wrap from the last view to the first,
/// because the first view belongs to another lobe there.
enum class ViewFilter {
  Nearest,  ///< the one view whose span contains v
  Linear,   ///< the two views whose centres enclose v; beyond the outermost centres the outermost
            ///< view
  Gauss,    ///< a Gaussian around v with the width of the rig's lens spot, over the existing views
};

/// PictureFit places a view on a panel of another aspect, always centred. Aspects within 0.5 %
/// count as equal: file names round aspects, and a bar one pixel wide would be useless.
enum class PictureFit {
  Contain,  ///< the whole view, with black bars
  Cover,    ///< the whole panel, with the view cropped
  Stretch,  ///< both, distorted
};

/// ViewOrder is the direction of the cameras, starting at view 0.
enum class ViewOrder { LeftToRight, RightToLeft };

/// Parse "nearest", "linear", "gauss" and "contain", "cover", "stretch". Throw Error(Usage) for
/// other texts.
[[nodiscard]] ViewFilter parse_view_filter(const std::string& text);
[[nodiscard]] PictureFit parse_picture_fit(const std::string& text);
[[nodiscard]] const char* to_string(ViewFilter filter);
[[nodiscard]] const char* to_string(PictureFit fit);

struct WeaveOptions {
  std::optional<ViewFilter> filter{};  ///< none: the choice of view_filter()
  PictureFit fit = PictureFit::Contain;
  ViewOrder order = ViewOrder::LeftToRight;
};

/// Returns the filter of the options. If they have none: Nearest for views that are wider than the
/// sheet's spot and than half a pixel, so that the sheet keeps them apart; otherwise Linear.
[[nodiscard]] ViewFilter view_filter(const WeaveOptions& options, const optics::LensSheet& sheet,
                                     int views);

/// PicturePlace is the position of a view of `aspect` on a panel, centred.
struct PicturePlace {
  double scale_u = 0.0;  ///< view widths per mm
  double scale_v = 0.0;  ///< view heights per mm
  bool bars_beside = false;
  bool bars_above = false;

  /// Return the position of a panel point in a view, as fractions from the left and from the top.
  [[nodiscard]] double u(double x_mm) const { return 0.5 + x_mm * scale_u; }
  [[nodiscard]] double v(double y_mm) const { return 0.5 - y_mm * scale_v; }
};
[[nodiscard]] PicturePlace place_picture(const optics::Panel& panel, double aspect, PictureFit fit);

/// Returns the view whose span contains `view_number` in (0, views]: spans are open on the left, so
/// that v = k + 1 still belongs to view k, as v = views does to the last view.
[[nodiscard]] int nearest_view(double view_number, int views);

/// Computes the weight of each of `views` views at view number `view_number` in (0, views]. Returns
/// the first view; its weight and those of its right neighbours replace the content of `weights`
/// and sum to 1. `spot_sigma_views` is used by Gauss only.
[[nodiscard]] int view_weights(double view_number, int views, ViewFilter filter,
                               double spot_sigma_views, std::vector<double>& weights);

// Decodes the views of a woven frame: the pictures seen by eyes that stand where each view is aimed
// at.

/// Returns optics::simulate_eye() of the frame. Throws Error(Input) as that does.
[[nodiscard]] WovenFrame seen_by(const optics::OpticalModel& model, const FrameView& woven,
                                 const optics::Eye& eye, const optics::EyeOptions& options = {});

/// Returns the eye on the viewing line at the middle of view `view` of `views`; 0 is the leftmost.
/// Rigs without a gap show the same picture everywhere, so their design eye is returned.
[[nodiscard]] optics::Eye eye_of_view(const optics::OpticalModel& model, int view, int views);

/// Returns one pixel per lens across, with square pixels: the resolution of a view of this sheet.
[[nodiscard]] FrameGeometry decoded_geometry(const optics::Rig& rig);

/// Returns the picture that the view's eye sees, at decoded_geometry(). Throws Error(Input) if the
/// frame does not have the panel's size.
[[nodiscard]] WovenFrame decode_view(const FrameView& woven, const optics::OpticalModel& model,
                                     int view, int views);

}  // namespace lenticule::frames
