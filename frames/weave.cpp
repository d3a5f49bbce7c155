// SPDX-License-Identifier: Apache-2.0
#include "frames/weave.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "base/error_kinds.h"
#include "optics/eye_simulator.h"

namespace lenticule::frames {
namespace {

/// A view further than this many sigmas is ignored (0.01 % of the centre's weight).
constexpr double kGaussReach = 4.3;

/// Smallest sigma of a Gaussian, in views.
constexpr double kSharpestSpot = 1e-3;
/// Full width at half maximum of a Gaussian with sigma 1.
constexpr double kWidthOfSigma = 2.3548;
constexpr int kColours = 3;
constexpr double kSameAspect = 0.005;

template <class Value>
struct Name {
  const char* text;
  Value value;
};
constexpr std::array<Name<ViewFilter>, 3> kFilters = {{{"nearest", ViewFilter::Nearest},
                                                       {"linear", ViewFilter::Linear},
                                                       {"gauss", ViewFilter::Gauss}}};
constexpr std::array<Name<PictureFit>, 3> kFits = {{{"contain", PictureFit::Contain},
                                                    {"cover", PictureFit::Cover},
                                                    {"stretch", PictureFit::Stretch}}};

template <class Value, size_t N>
Value parse_name(const std::array<Name<Value>, N>& names, const std::string& text,
                 const char* what) {
  std::string known;
  for (const Name<Value>& name : names) {
    if (text == name.text) return name.value;
    known += (known.empty() ? "" : ", ") + std::string(name.text);
  }
  throw usage_error("{} '{}': unknown", what, text).remedy("one of " + known);
}

template <class Value, size_t N>
const char* name_of(const std::array<Name<Value>, N>& names, Value value) {
  for (const Name<Value>& name : names)
    if (name.value == value) return name.text;
  return "";
}

int gauss_weights(double centre, int views, double sigma, std::vector<double>& weights) {
  const int nearest = std::clamp(static_cast<int>(std::lround(centre)), 0, views - 1);
  if (!(sigma > kSharpestSpot)) {
    weights.assign(1, 1.0);
    return nearest;
  }
  const double reach = kGaussReach * sigma;
  const int first = std::min(nearest, std::max(0, static_cast<int>(std::ceil(centre - reach))));
  const int last =
      std::max(nearest, std::min(views - 1, static_cast<int>(std::floor(centre + reach))));
  const double scale = 0.5 / (sigma * sigma);
  // Weights are relative to the nearest view's weight, so that not all of them underflow for a
  // small sigma.
  const double least = (nearest - centre) * (nearest - centre);
  double sum = 0.0;
  weights.clear();
  for (int view = first; view <= last; ++view) {
    const double distance = view - centre;
    weights.push_back(std::exp(-(distance * distance - least) * scale));
    sum += weights.back();
  }
  for (double& weight : weights) weight /= sum;
  return first;
}

}  // namespace

ViewFilter parse_view_filter(const std::string& text) {
  return parse_name(kFilters, text, "filter");
}
PictureFit parse_picture_fit(const std::string& text) { return parse_name(kFits, text, "fit"); }
const char* to_string(ViewFilter filter) { return name_of(kFilters, filter); }
const char* to_string(PictureFit fit) { return name_of(kFits, fit); }

ViewFilter view_filter(const WeaveOptions& options, const optics::LensSheet& sheet, int views) {
  const double spot_width = kWidthOfSigma * sheet.spot_sigma.value;  // unit: lenses
  const double from_eye = kColours / 2.0 / sheet.pitch.value;
  const bool apart = views * std::max(spot_width, from_eye) < 1.0;
  return options.filter.value_or(apart ? ViewFilter::Nearest : ViewFilter::Linear);
}

int nearest_view(double view_number, int views) {
  // A number that rounding puts slightly beyond a border counts as on the border, as with lenses:
  // at rational pitches whole columns of subpixels lie exactly there.
  const double on_border = view_number - views * optics::kBorderTolerance;
  return std::clamp(static_cast<int>(std::ceil(on_border)) - 1, 0, views - 1);
}

int view_weights(double view_number, int views, ViewFilter filter, double spot_sigma_views,
                 std::vector<double>& weights) {
  const double centre = view_number - 0.5;  // unit: view indices
  if (filter == ViewFilter::Gauss) return gauss_weights(centre, views, spot_sigma_views, weights);
  if (filter == ViewFilter::Nearest) {
    weights.assign(1, 1.0);
    return nearest_view(view_number, views);
  }
  const double inside = std::clamp(centre, 0.0, views - 1.0);
  const int left = static_cast<int>(inside);
  const double share = inside - left;
  weights.assign(1, 1.0 - share);
  if (share > 0.0) weights.push_back(share);
  return left;
}

PicturePlace place_picture(const optics::Panel& panel, double aspect, PictureFit fit) {
  const double panel_width_mm = panel.width_px * panel.pixel_width.value;
  const double panel_height_mm = panel.height_px * panel.pixel_height.value;
  const double wider =
      aspect * panel_height_mm / panel_width_mm;  // aspect of the view relative to the panel's
  double width_mm = panel_width_mm;               // width of a view on the panel
  double height_mm = panel_height_mm;
  if (fit != PictureFit::Stretch && std::abs(wider - 1.0) > kSameAspect) {
    const bool keep_width = (wider > 1.0) == (fit == PictureFit::Contain);
    if (keep_width)
      height_mm = panel_width_mm / aspect;
    else
      width_mm = panel_height_mm * aspect;
  }
  return {.scale_u = 1.0 / width_mm,
          .scale_v = 1.0 / height_mm,
          .bars_beside = width_mm < panel_width_mm,
          .bars_above = height_mm < panel_height_mm};
}

optics::Eye eye_of_view(const optics::OpticalModel& model, int view, int views) {
  optics::Eye eye = model.design_eye();
  const double gap_mm = model.rig().sheet.gap.value;
  if (gap_mm == 0.0) return eye;
  const double lobes_from_middle = (view + 0.5) / views - 0.5;
  // An eye at infinity is a direction, so the lobe's width is a difference of tangents.
  eye.x += lobes_from_middle *
           (std::isinf(eye.z_mm) ? model.pitch_mm() / gap_mm : model.lobe_width_mm(eye.z_mm));
  return eye;
}

WovenFrame seen_by(const optics::OpticalModel& model, const FrameView& woven,
                   const optics::Eye& eye, const optics::EyeOptions& options) {
  const FrameGeometry& size = woven.geometry;
  const optics::RgbPicture seen = optics::simulate_eye(model,
                                                       {.pixels = woven.bytes.data(),
                                                        .width = size.width,
                                                        .height = size.height,
                                                        .stride_bytes = size.row_bytes()},
                                                       eye, options);
  WovenFrame picture({.width = seen.width, .height = seen.height});
  std::ranges::copy(seen.pixels, picture.bytes().begin());
  return picture;
}

FrameGeometry decoded_geometry(const optics::Rig& rig) {
  const optics::Panel& panel = rig.panel;
  const double lenses = 3.0 * panel.width_px / rig.sheet.pitch.value;
  const double width_mm = panel.width_px * panel.pixel_width.value;
  const double height_mm = panel.height_px * panel.pixel_height.value;
  const auto side = [](double pixels) {
    return std::max(1, static_cast<int>(std::lround(pixels)));
  };
  return {.width = side(lenses), .height = side(lenses * height_mm / width_mm)};
}

WovenFrame decode_view(const FrameView& woven, const optics::OpticalModel& model, int view,
                       int views) {
  const FrameGeometry geometry = decoded_geometry(model.rig());
  return seen_by(model, woven, eye_of_view(model, view, views),
                 {.width = geometry.width, .height = geometry.height});
}

}  // namespace lenticule::frames
