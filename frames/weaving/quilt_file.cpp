// SPDX-License-Identifier: Apache-2.0
#include "frames/weaving/quilt_file.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "base/error.h"
#include "frames/image_io.h"

namespace lenticule::frames {
namespace {

/// Rounds the aspect to three decimals, as other programs write it in names.
double named_aspect(double aspect) {
  return std::max(0.001, std::round(aspect * 1000.0) / 1000.0);
}

}  // namespace

QuiltLayout quilt_layout_for(const ViewShape& views) {
  const double shape = static_cast<double>(views.height) / views.width;
  const int columns =
      std::clamp(static_cast<int>(std::lround(std::sqrt(views.count * shape))), 1, views.count);
  return {.columns = columns,
          .rows = (views.count + columns - 1) / columns,
          .views = views.count,
          .aspect = named_aspect(views.aspect)};
}

QuiltLayout quilt_layout_for(const ViewSet& views) {
  return quilt_layout_for(shape_of(views));
}

FrameGeometry quilt_geometry(const ViewShape& views, const QuiltLayout& layout) {
  return {.width = layout.columns * views.width, .height = layout.rows * views.height};
}

WovenFrame draw_quilt(const ViewSet& views, const QuiltLayout& layout) {
  check_quilt_layout(layout, "quilt");
  if (layout.view_count() != views.count())
    throw Error(ErrorKind::Usage, fmt::format("quilt: {} tiles are used, but there are {} views",
                                              layout.view_count(), views.count()));
  WovenFrame quilt(quilt_geometry(shape_of(views), layout));
  draw_quilt(views, layout, quilt);
  return quilt;
}

void draw_quilt(const ViewSet& views, const QuiltLayout& layout, WovenFrame& quilt) {
  for (int view = 0; view < views.count(); ++view) {
    const int left = view % layout.columns * views.width();
    const int top = quilt.height() - (view / layout.columns + 1) * views.height();
    for (int row = 0; row < views.height(); ++row)
      std::copy_n(views.pixel(view, 0, row), static_cast<size_t>(views.width()) * 3,
                  quilt.row(top + row) + static_cast<size_t>(left) * 3);
  }
}

std::filesystem::path quilt_name(const std::filesystem::path& file, const QuiltLayout& layout) {
  if (const auto named = quilt_layout_of_name(file)) {
    const bool same_aspect =
        !named->aspect || !layout.aspect || std::abs(*named->aspect - *layout.aspect) < 0.001;
    if (named->columns == layout.columns && named->rows == layout.rows && same_aspect) return file;
    throw Error(ErrorKind::Usage,
                fmt::format("{}: its name states another layout than {} x {} tiles", file.string(),
                            layout.columns, layout.rows),
                "leave the layout out of the name; it is added");
  }
  std::string name = fmt::format("{}_qs{}x{}", file.stem().string(), layout.columns, layout.rows);
  if (layout.aspect) name += fmt::format("a{:.4g}", *layout.aspect);
  return file.parent_path() / (name + file.extension().string());
}

std::filesystem::path write_quilt(const ViewSet& views, const std::filesystem::path& file) {
  const QuiltLayout layout = quilt_layout_for(views);
  const std::filesystem::path name = quilt_name(file, layout);
  write_woven(draw_quilt(views, layout).view(), name);
  return name;
}

}  // namespace lenticule::frames
