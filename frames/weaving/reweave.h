// SPDX-License-Identifier: Apache-2.0
// Converts a frame woven for one rig to another rig: decodes the frame into views and weaves them
// again.
#pragma once

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <utility>
#include <vector>

#include "base/error_kinds.h"
#include "frames/frame.h"
#include "frames/image_io.h"
#include "frames/quilt.h"
#include "frames/srgb.h"
#include "frames/weave.h"
#include "frames/weaving/weave_plan.h"
#include "optics/model.h"
#include "optics/row_rays.h"

namespace lenticule::frames {

/// Returns a grid for the views whose picture is about as wide as high. Its aspect has the three
/// decimals that other programs write in names.
[[nodiscard]] inline QuiltLayout quilt_layout_for(const ViewShape& views) {
  const double shape = static_cast<double>(views.height) / views.width;
  const int columns =
      std::clamp(static_cast<int>(std::lround(std::sqrt(views.count * shape))), 1, views.count);
  return {.columns = columns,
          .rows = (views.count + columns - 1) / columns,
          .views = views.count,
          .aspect = std::max(0.001, std::round(views.aspect * 1000.0) / 1000.0)};
}

/// Returns the size of the quilt.
[[nodiscard]] inline FrameGeometry quilt_geometry(const ViewShape& views,
                                                  const QuiltLayout& layout) {
  return {.width = layout.columns * views.width, .height = layout.rows * views.height};
}

/// Draws into a frame of the quilt's size, for a layout with a tile for each view; unused tiles
/// stay unchanged.
inline void draw_quilt(const ViewSet& views, const QuiltLayout& layout, WovenFrame& quilt) {
  for (int view = 0; view < views.count(); ++view) {
    const int left = view % layout.columns * views.width();
    const int top = quilt.height() - (view / layout.columns + 1) * views.height();
    for (int row = 0; row < views.height(); ++row)
      std::copy_n(views.pixel(view, 0, row), static_cast<size_t>(views.width()) * 3,
                  quilt.row(top + row) + static_cast<size_t>(left) * 3);
  }
}

/// Returns the quilt as one picture; unused tiles are black. Throws Error(Usage) if the layout has
/// fewer tiles than there are views.
[[nodiscard]] inline WovenFrame draw_quilt(const ViewSet& views, const QuiltLayout& layout) {
  check_quilt_layout(layout, "quilt");
  if (layout.view_count() != views.count())
    throw usage_error("quilt: {} tiles are used, but there are {} views", layout.view_count(),
                      views.count());
  WovenFrame quilt(quilt_geometry(shape_of(views), layout));
  draw_quilt(views, layout, quilt);
  return quilt;
}

/// Returns "city_qs8x6a0.75.png" for "city.png"; a name that already states the layout stays
/// unchanged. Throws Error(Usage) if the name states another layout.
[[nodiscard]] inline std::filesystem::path quilt_name(const std::filesystem::path& file,
                                                      const QuiltLayout& layout) {
  if (const auto named = quilt_layout_of_name(file)) {
    const bool same_aspect =
        !named->aspect || !layout.aspect || std::abs(*named->aspect - *layout.aspect) < 0.001;
    if (named->columns == layout.columns && named->rows == layout.rows && same_aspect) return file;
    throw usage_error("{}: its name states another layout than {} x {} tiles", file.string(),
                      layout.columns, layout.rows)
        .remedy("leave the layout out of the name; it is added");
  }
  std::string name = fmt::format("{}_qs{}x{}", file.stem().string(), layout.columns, layout.rows);
  if (layout.aspect) name += fmt::format("a{:.4g}", *layout.aspect);
  return file.parent_path() / (name + file.extension().string());
}

/// Writes the quilt atomically and returns the name of the file. Throws the errors of
/// write_woven().
inline std::filesystem::path write_quilt(const ViewSet& views, const std::filesystem::path& file) {
  const QuiltLayout layout = quilt_layout_for(shape_of(views));
  const std::filesystem::path name = quilt_name(file, layout);
  write_woven(draw_quilt(views, layout).view(), name);
  return name;
}

/// Gathered accumulates a view's picture from subpixels: light and weight per pixel and colour.
class Gathered {
 public:
  explicit Gathered(FrameGeometry geometry)
      : geometry_(geometry), light_(geometry.frame_bytes()), weight_(geometry.frame_bytes()) {}

  void clear() {
    std::fill(light_.begin(), light_.end(), 0.0F);
    std::fill(weight_.begin(), weight_.end(), 0.0F);
  }

  /// Distributes a subpixel at fractions (u, v) of the picture over the four pixels around it.
  void add(double u, double v, size_t channel, float light, double weight) {
    const double x = std::clamp(u * geometry_.width - 0.5, 0.0, geometry_.width - 1.0);
    const double y = std::clamp(v * geometry_.height - 0.5, 0.0, geometry_.height - 1.0);
    const int left = static_cast<int>(x), top = static_cast<int>(y);
    for (const auto& [column, across] : {std::pair{left, 1.0 - (x - left)}, {left + 1, x - left}})
      for (const auto& [row, down] : {std::pair{top, 1.0 - (y - top)}, {top + 1, y - top}}) {
        if (column >= geometry_.width || row >= geometry_.height) continue;
        const size_t at = static_cast<size_t>(row) * geometry_.row_bytes() +
                          static_cast<size_t>(column) * 3 + channel;
        const auto share = static_cast<float>(weight * across * down);
        light_[at] += share * light;
        weight_[at] += share;
      }
  }

  /// Returns the picture; pixels with hardly any weight keep the value of `otherwise`.
  [[nodiscard]] WovenFrame picture(WovenFrame otherwise) const {
    constexpr float kEnough = 0.05F;
    for (size_t n = 0; n < light_.size(); ++n)
      if (weight_[n] > kEnough) otherwise.bytes()[n] = code_from_linear(light_[n] / weight_[n]);
    return otherwise;
  }

 private:
  FrameGeometry geometry_;
  std::vector<float> light_, weight_;
};

/// Adds every subpixel that shows `view`, or is less than a view off, to the view's picture.
inline void gather_view(const FrameView& woven, const optics::RowRayEvaluator& evaluator,
                        const PicturePlace& place, int view, int views, Gathered& picture) {
  optics::RowRays rays;
  picture.clear();
  for (int j = 0; j < woven.geometry.height; ++j) {
    evaluator.evaluate(j, 0, woven.geometry.width, rays);
    const uint8_t* const codes = woven.row(j);
    for (size_t s = 0; s < rays.size(); ++s) {
      const double off = std::abs(optics::view_number(rays.place[s], views) - (view + 0.5));
      if (off >= 1.0) continue;
      picture.add(place.u(rays.lens_x_mm[s]), place.v(rays.lens_y_mm[s]), s % 3,
                  static_cast<float>(linear_of_codes()[codes[s]]), 1.0 - off);
    }
  }
}

/// Returns the number of whole subpixels under a lens, which is the number of views in the frame.
/// At least 2.
[[nodiscard]] inline int views_in_woven(const optics::Rig& rig) {
  return std::clamp(static_cast<int>(std::lround(rig.sheet.pitch.value)), 2, kMaxViews);
}

/// Decodes a woven frame: view k of `views` is the picture that an eye in the middle of that part
/// of the rig's lobe sees, one pixel per lens, with the panel's aspect. View k of one rig's lobe
/// becomes view k of the other's, as with quilts. Throws Error(Input) if the frame does not have
/// the panel's size.
[[nodiscard]] inline ViewSet views_of_woven(const FrameView& woven,
                                            const optics::OpticalModel& model, int views) {
  LENTICULE_CHECK(views > 0);
  const optics::Panel& panel = model.rig().panel;
  if (woven.geometry != FrameGeometry{.width = panel.width_px, .height = panel.height_px})
    throw Error(
        ErrorKind::Input,
        fmt::format("woven frame: {}x{} pixels, but the rig's panel has {}x{}",
                    woven.geometry.width, woven.geometry.height, panel.width_px, panel.height_px),
        "use the rig that it was woven for");
  const double aspect =
      panel.width_px * panel.pixel_width.value / (panel.height_px * panel.pixel_height.value);
  const PicturePlace place = place_picture(panel, aspect, PictureFit::Stretch);
  const optics::RowRayEvaluator evaluator(model);
  Gathered picture(decoded_geometry(model.rig()));
  std::vector<WovenFrame> pictures;
  for (int view = 0; view < views; ++view) {
    gather_view(woven, evaluator, place, view, views, picture);
    pictures.push_back(picture.picture(decode_view(woven, model, view, views)));
  }
  return ViewSet(std::move(pictures), aspect);
}

}  // namespace lenticule::frames
