// SPDX-License-Identifier: Apache-2.0
// Weaving: views become the woven frame of a rig. This is the reference: scalar, in double, one
// subpixel after the other; whatever is faster has to agree with it.
#pragma once

#include <string>
#include <vector>

#include "frames/frame.h"
#include "frames/quilt.h"
#include "optics/model.h"
#include "optics/row_rays.h"

namespace lenticule::frames {

/// How the views beside a subpixel's view number v contribute. View k spans (k, k + 1] and has its
/// centre at k + 1/2. Nothing ever wraps from the last view to the first: that is another lobe.
enum class ViewFilter {
  Nearest,  ///< the one view whose span holds v
  Linear,   ///< the two whose centres enclose v; beyond the outermost centres the outermost view
  Gauss,    ///< a Gaussian around v as wide as the rig's lens spot, over the views there are
};

/// How a view is placed on a panel of another aspect, always centred. Aspects within 0.5 % count as
/// equal: file names round them, and nobody wants a bar one pixel wide.
enum class PictureFit {
  Contain,  ///< all of the view, black bars beside it
  Cover,    ///< all of the panel, the view cropped
  Stretch,  ///< both, distorted
};

/// Where the camera of view 0 stood.
enum class ViewOrder { LeftToRight, RightToLeft };

/// "nearest", "linear", "gauss" / "contain", "cover", "stretch"; throws Error(Usage) otherwise.
[[nodiscard]] ViewFilter parse_view_filter(const std::string& text);
[[nodiscard]] PictureFit parse_picture_fit(const std::string& text);
[[nodiscard]] const char* to_string(ViewFilter filter);
[[nodiscard]] const char* to_string(PictureFit fit);

struct WeaveOptions {
  ViewFilter filter = ViewFilter::Linear;
  PictureFit fit = PictureFit::Contain;
  ViewOrder order = ViewOrder::LeftToRight;
};

/// Where a view of `aspect` lies on a panel, centred.
struct PicturePlace {
  double scale_u = 0.0;  ///< view widths per mm
  double scale_v = 0.0;  ///< view heights per mm
  bool bars_beside = false;
  bool bars_above = false;

  /// A panel point in a view, as fractions of it from the left and from the top.
  [[nodiscard]] double u(double x_mm) const { return 0.5 + x_mm * scale_u; }
  [[nodiscard]] double v(double y_mm) const { return 0.5 - y_mm * scale_v; }
  /// Where there is no bar, a lens point a hair outside the panel still shows the view's border.
  [[nodiscard]] bool in_bars(double u, double v) const {
    return (bars_beside && !(u >= 0.0 && u < 1.0)) || (bars_above && !(v >= 0.0 && v < 1.0));
  }
};
[[nodiscard]] PicturePlace place_picture(const optics::Panel& panel, double aspect, PictureFit fit);

/// The view whose span holds `view_number` in (0, views]: spans are open on the left, so that v = k
/// + 1 still belongs to view k, as v = views does to the last.
[[nodiscard]] int nearest_view(double view_number, int views);

/// The share of each of `views` views at view number `view_number` in (0, views]. Returns the first
/// view; its weight and those of its right neighbours replace the content of `weights` and sum
/// to 1. `spot_sigma_views` matters to Gauss only.
[[nodiscard]] int view_weights(double view_number, int views, ViewFilter filter,
                               double spot_sigma_views, std::vector<double>& weights);

/// Weaves one set of views for one rig. Each subpixel takes its own channel of the point where its
/// ray crosses the glass (views are off-axis cameras focused on the glass), bilinear inside each
/// view and mixed in linear light: that is what an eye's retina does. Where a single pixel counts
/// its code value is kept exactly. Holds references: both must outlive it. weave_rows is safe from
/// several threads for different rows.
class Weaver {
 public:
  Weaver(const ViewSet& views, const optics::OpticalModel& model, const WeaveOptions& options = {});

  [[nodiscard]] FrameGeometry geometry() const;
  /// Fills rows [begin, end) of a frame of geometry().
  void weave_rows(int begin, int end, WovenFrame& frame) const;

 private:
  /// Where a panel point lies in a view, as fractions of it from the left and from the top.
  struct PicturePoint {
    double u;
    double v;
  };
  [[nodiscard]] double light_at(int view, PicturePoint point, int channel) const;
  [[nodiscard]] uint8_t subpixel(const optics::RowRays& rays, size_t s, int channel,
                                 std::vector<double>& weights) const;

  const ViewSet& views_;
  optics::RowRayEvaluator rays_;
  WeaveOptions options_;
  PicturePlace place_;
};

/// The whole frame at once.
[[nodiscard]] WovenFrame weave(const ViewSet& views, const optics::OpticalModel& model,
                               const WeaveOptions& options = {});

}  // namespace lenticule::frames
