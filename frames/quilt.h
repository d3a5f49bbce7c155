// SPDX-License-Identifier: Apache-2.0
// N views of one scene, from the leftmost camera to the rightmost: a quilt (one picture of tiles)
// or a picture per view.
#pragma once

#include <cstddef>
#include <filesystem>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "frames/frame.h"
#include "frames/image_io.h"

namespace lenticule::frames {

inline constexpr int kMaxViews = 4096;

/// How the tiles of a quilt lie: tile 0 is the bottom-left one and the leftmost camera's; the next
/// are to its right, then row by row upward. Tiles after the last view (at the top right) are
/// unused, so that any number of views fits a grid, also a prime one or a strip of 1 x N.
struct QuiltLayout {
  int columns = 1;
  int rows = 1;
  /// Views in it, at most columns * rows; 0 = all tiles.
  int views = 0;
  /// Width / height of one view as it is meant to be seen; absent = that of a tile's pixels. Tiles
  /// may be squeezed.
  std::optional<double> aspect = std::nullopt;

  [[nodiscard]] int view_count() const { return views > 0 ? views : columns * rows; }
  friend bool operator==(const QuiltLayout&, const QuiltLayout&) = default;
};

/// Throws Error(Usage), its message starting with `context`, for a layout that no picture can have.
void check_quilt_layout(const QuiltLayout& layout, const std::string& context);

/// The layout in a file's name, "city_qs8x6a0.75.png": 8 columns, 6 rows, aspect 0.75 (which may be
/// missing). Whatever follows is ignored. Empty if the name has none or it makes no sense.
[[nodiscard]] std::optional<QuiltLayout> quilt_layout_of_name(const std::filesystem::path& file);

struct TileSize {
  int width = 0;
  int height = 0;
};
/// Of a quilt's tiles: whole pixels from the bottom-left corner on. Throws Error(Input) if a tile
/// would have no pixel, Error(Usage) for a layout that makes no sense.
[[nodiscard]] TileSize tile_size(const FrameGeometry& quilt, const QuiltLayout& layout,
                                 const std::string& name = "quilt");

/// The views, all of one size, with the pixels they need. Immutable; safe from any thread.
class ViewSet {
 public:
  /// Cuts a quilt. Tiles are whole pixels from the bottom-left corner on; a rest that does not
  /// divide stays unused at the right and the top. Throws Error(Input) if a tile would have no
  /// pixel, Error(Usage) for a layout that makes no sense.
  ViewSet(WovenFrame quilt, const QuiltLayout& layout, const std::string& name = "quilt");
  /// The same of a picture that somebody else owns and that outlives this.
  [[nodiscard]] static ViewSet borrow(const FrameView& quilt, const QuiltLayout& layout,
                                      const std::string& name = "quilt");
  /// One picture per view, that somebody else owns. Throws as the next one.
  [[nodiscard]] static ViewSet borrow(std::span<const FrameView> views,
                                      std::optional<double> aspect = std::nullopt);
  /// One picture per view. Throws Error(Input) when empty, or sizes differ.
  explicit ViewSet(std::vector<WovenFrame> views, std::optional<double> aspect = std::nullopt);

  /// The same pictures, the last one as the leftmost camera's.
  [[nodiscard]] ViewSet reversed() &&;

  [[nodiscard]] int count() const { return static_cast<int>(first_pixels_.size()); }
  [[nodiscard]] int width() const { return width_; }
  [[nodiscard]] int height() const { return height_; }
  /// Width / height of a view as it is meant to be seen.
  [[nodiscard]] double aspect() const { return aspect_; }
  /// From one row of a view to the next.
  [[nodiscard]] size_t stride_bytes() const { return stride_bytes_; }

  /// The RGB of a view's pixel; row 0 is the top one.
  [[nodiscard]] const uint8_t* pixel(int view, int column, int row) const {
    return first_pixels_[static_cast<size_t>(view)] + static_cast<size_t>(row) * stride_bytes_ +
           static_cast<size_t>(column) * 3;
  }

 private:
  ViewSet() = default;
  void cut(const FrameView& quilt, const QuiltLayout& layout, const std::string& name);
  void take(std::span<const FrameView> views, std::optional<double> aspect);
  void set_aspect(std::optional<double> aspect, const std::string& name);

  std::vector<WovenFrame> pictures_;
  std::vector<const uint8_t*> first_pixels_;  // by view, into pictures_
  size_t stride_bytes_ = 0;
  int width_ = 0;
  int height_ = 0;
  double aspect_ = 1.0;
};

/// The aspect that pixels of that shape give a picture; empty for square ones, which say nothing.
[[nodiscard]] std::optional<double> stated_aspect(const FrameGeometry& picture,
                                                  double pixel_aspect);

/// All views of one moment together take no more, unless a caller allows less.
inline constexpr uint64_t kMostViewBytes = uint64_t{8} << 30;

/// Reads and cuts a quilt file.
[[nodiscard]] ViewSet read_quilt(const std::filesystem::path& file, const QuiltLayout& layout);

/// Reads one picture per view, the leftmost camera's first. Throws Error(Input), that of the set
/// itself beginning with `name`, for sizes that differ or more bytes of pixels than `most_bytes`.
/// Pictures are turned as their tags say, and the shape of their pixels counts unless `aspect` is
/// given.
[[nodiscard]] ViewSet read_views(const std::vector<std::filesystem::path>& files,
                                 const std::string& name,
                                 std::optional<double> aspect = std::nullopt,
                                 uint64_t most_bytes = kMostViewBytes);
/// The same of a pattern; the lowest number is the leftmost camera. Throws Error(Input) also for no
/// files and a missing number.
[[nodiscard]] ViewSet read_views(const FilePattern& pattern,
                                 std::optional<double> aspect = std::nullopt);

}  // namespace lenticule::frames
