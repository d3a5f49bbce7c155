// SPDX-License-Identifier: Apache-2.0
#include "frames/quilt.h"

#include <fmt/format.h>

#include <algorithm>
#include <cctype>
#include <cmath>
#include <utility>

#include "base/error_kinds.h"
#include "base/numbers.h"
#include "base/text.h"
#include "frames/decoded_source.h"

namespace lenticule::frames {
namespace {

constexpr double kMinAspect = 0.01;
constexpr double kMaxAspect = 100.0;
constexpr double kMostZoom = 16.0;

bool sensible_aspect(double aspect) { return aspect >= kMinAspect && aspect <= kMaxAspect; }

void require_aspect(double aspect, const std::string& context) {
  if (!sensible_aspect(aspect))
    throw usage_error("{}: aspect {} is out of range", context, aspect)
        .remedy("the aspect of a view is its width over its height, for example 0.75");
}

bool sensible_grid(int columns, int rows) {
  return columns >= 1 && rows >= 1 && columns <= kMaxViews && rows <= kMaxViews / columns;
}

bool take(std::string_view& text, char c) {
  if (!text.starts_with(c)) return false;
  text.remove_prefix(1);
  return true;
}

/// Removes a number such as "0.75", or a ratio such as "3:4", from the front; no exponent, so that
/// letters after the number keep their own meaning.
std::optional<double> take_aspect(std::string_view& text) {
  auto aspect = take_number<double>(text, std::chars_format::fixed);
  if (aspect && take(text, ':')) {
    const auto height = take_number<double>(text, std::chars_format::fixed);
    aspect = height ? std::optional(*aspect / *height) : std::nullopt;
  }
  return aspect && sensible_aspect(*aspect) ? aspect : std::nullopt;
}

/// Parses what follows "qs" in a name.
std::optional<QuiltLayout> take_layout(std::string_view text) {
  const auto columns = take_number<int>(text);
  const auto rows = columns && take(text, 'x') ? take_number<int>(text) : std::nullopt;
  if (!rows || !sensible_grid(*columns, *rows)) return std::nullopt;
  QuiltLayout layout{.columns = *columns, .rows = *rows};
  if (take(text, 'v')) {
    const auto views = take_number<int>(text);
    if (!views || *views < 1 || *views > *columns * *rows) return std::nullopt;
    layout.views = *views;
  }
  if (take(text, 'a')) {
    layout.aspect = take_aspect(text);
    if (!layout.aspect) return std::nullopt;
  }
  for (bool zoom = take(text, 'z'); zoom || take(text, 'f'); zoom = take(text, 'z')) {
    const auto number = take_number<double>(text, std::chars_format::fixed);
    if (!number) break;
    if (zoom) layout.zoom = *number;
  }
  return layout;
}

}  // namespace

void check_quilt_layout(const QuiltLayout& layout, const std::string& context) {
  if (!sensible_grid(layout.columns, layout.rows))
    throw usage_error("{}: a grid of {} x {} tiles is not supported", context, layout.columns,
                      layout.rows)
        .remedy(fmt::format("columns and rows must be at least 1, and their product at most {}",
                            kMaxViews));
  if (layout.views < 0 || layout.views > layout.columns * layout.rows)
    throw usage_error("{}: {} views in a grid of {} x {} tiles", context, layout.views,
                      layout.columns, layout.rows);
  if (layout.aspect) require_aspect(*layout.aspect, context);
}

std::optional<QuiltLayout> quilt_layout_of_name(const std::filesystem::path& file) {
  const std::string stem = lower_case(file.stem().string());
  for (size_t at = stem.rfind("qs"); at != std::string::npos;
       at = at == 0 ? std::string::npos : stem.rfind("qs", at - 1)) {
    const bool begins_word = at == 0 || std::isalnum(static_cast<unsigned char>(stem[at - 1])) == 0;
    if (!begins_word) continue;
    if (const auto layout = take_layout(std::string_view(stem).substr(at + 2))) return layout;
  }
  return std::nullopt;
}

TileSize tile_size(const FrameGeometry& quilt, const QuiltLayout& layout, const std::string& name) {
  check_quilt_layout(layout, name);
  const TileSize tile{.width = quilt.width / layout.columns, .height = quilt.height / layout.rows};
  if (tile.width < 1 || tile.height < 1)
    throw input_error("{}: {} x {} pixels are too few for {} x {} tiles", name, quilt.width,
                      quilt.height, layout.columns, layout.rows);
  return tile;
}

ViewSet::ViewSet(WovenFrame quilt, const QuiltLayout& layout, const std::string& name) {
  pictures_.push_back(std::move(quilt));
  cut(pictures_.front().view(), layout, name);
}

ViewSet ViewSet::borrow(const FrameView& quilt, const QuiltLayout& layout,
                        const std::string& name) {
  ViewSet views;
  views.cut(quilt, layout, name);
  return views;
}

void ViewSet::cut(const FrameView& quilt, const QuiltLayout& layout, const std::string& name) {
  const FrameGeometry& geometry = quilt.geometry;
  const TileSize tile = tile_size(geometry, layout, name);
  width_ = tile.width;
  height_ = tile.height;
  set_aspect(layout.aspect, name);
  stride_bytes_ = geometry.row_bytes();
  for (int view = 0; view < layout.view_count(); ++view) {
    const int column = view % layout.columns;
    const int row_from_bottom = view / layout.columns;
    const int top = geometry.height - (row_from_bottom + 1) * height_;
    first_pixels_.push_back(quilt.row(top) + static_cast<size_t>(column * width_) * 3);
  }
}

ViewSet::ViewSet(std::vector<WovenFrame> views, std::optional<double> aspect)
    : pictures_(std::move(views)) {
  std::vector<FrameView> borrowed;
  borrowed.reserve(pictures_.size());
  for (const WovenFrame& picture : pictures_) borrowed.push_back(picture.view());
  take(borrowed, aspect);
}

ViewSet ViewSet::borrow(std::span<const FrameView> views, std::optional<double> aspect) {
  ViewSet set;
  set.take(views, aspect);
  return set;
}

void ViewSet::take(std::span<const FrameView> views, std::optional<double> aspect) {
  if (views.empty() || views.size() > static_cast<size_t>(kMaxViews))
    throw input_error("{} views; 1 to {} are supported", views.size(), kMaxViews);
  const FrameGeometry& geometry = views.front().geometry;
  for (const FrameView& picture : views) {
    if (picture.geometry != geometry || geometry.width < 1 || geometry.height < 1)
      throw Error(ErrorKind::Input, "views: their sizes differ, or are 0");
    first_pixels_.push_back(picture.bytes.data());
  }
  width_ = geometry.width;
  height_ = geometry.height;
  stride_bytes_ = geometry.row_bytes();
  set_aspect(aspect, "views");
}

ViewSet ViewSet::reversed() && {
  std::reverse(first_pixels_.begin(), first_pixels_.end());
  return std::move(*this);
}

TileSize cropped_size(const TileSize& view, const ViewCrop& crop) {
  const double shift = std::abs(crop.zero_plane.pixels(view.width));
  if (!(shift <= view.width - 1.0))
    throw Error(
        ErrorKind::Usage,
        fmt::format("zero plane: {} pixels, but a view has {}", std::round(shift), view.width),
        "a disparity must be smaller than the width of a view");
  const double zoom = crop.zoom > 1.0 ? std::min(crop.zoom, kMostZoom) : 1.0;
  const auto part = [&](int size) { return std::max(1, static_cast<int>(size / zoom)); };
  return {.width = std::min(part(view.width), view.width - static_cast<int>(std::ceil(shift))),
          .height = part(view.height)};
}

ViewSet ViewSet::cropped(const ViewCrop& crop) && {
  const TileSize part = cropped_size({.width = width_, .height = height_}, crop);
  const double shift = crop.zero_plane.pixels(width_);
  const int spare = width_ - part.width;
  const size_t above = static_cast<size_t>((height_ - part.height) / 2) * stride_bytes_;
  for (int view = 0; view < count(); ++view) {
    const double turn = count() > 1 ? static_cast<double>(view) / (count() - 1) - 0.5 : 0.0;
    const int left = static_cast<int>(std::lround(spare / 2.0 - shift * turn));
    first_pixels_[static_cast<size_t>(view)] +=
        above + static_cast<size_t>(std::clamp(left, 0, spare)) * 3;
  }
  aspect_ *= static_cast<double>(part.width) / width_ * height_ / part.height;
  width_ = part.width;
  height_ = part.height;
  return std::move(*this);
}

void ViewSet::set_aspect(std::optional<double> aspect, const std::string& name) {
  aspect_ = aspect.value_or(static_cast<double>(width_) / height_);
  if (aspect) require_aspect(aspect_, name);
}

ViewSet read_views(const std::vector<std::filesystem::path>& files, const std::string& name,
                   std::optional<double> aspect, uint64_t most_bytes) {
  LENTICULE_CHECK(!files.empty());
  const PictureInfo first = probe_picture(files.front(), PictureUse::Views);
  const FrameGeometry geometry = oriented_geometry(first.geometry, first.orientation);
  if (files.size() > static_cast<size_t>(kMaxViews) ||
      geometry.frame_bytes() > most_bytes / files.size())
    throw Error(
        ErrorKind::Input,
        fmt::format("{}: {} views of {} x {} pixels; the limits are {} views and {} MiB", name,
                    files.size(), geometry.width, geometry.height, kMaxViews, most_bytes >> 20),
        "use fewer or smaller views");
  std::vector<WovenFrame> views(files.size());
  for (size_t k = 0; k < files.size(); ++k)
    read_woven_into(files[k], geometry, views[k], PictureUse::Views);
  if (!aspect) aspect = stated_aspect(geometry, upright_pixel_aspect(first));
  return ViewSet(std::move(views), aspect);
}

std::optional<double> stated_aspect(const FrameGeometry& picture, double pixel_aspect) {
  if (pixel_aspect == 1.0) return std::nullopt;
  return picture.width * pixel_aspect / picture.height;
}

}  // namespace lenticule::frames
