// SPDX-License-Identifier: Apache-2.0
// ViewSet holds N views of one scene, from the leftmost camera to the rightmost: a quilt (one
// picture of tiles) or one picture per view.
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

/// QuiltLayout describes the tiles of a quilt: tile 0 is the bottom-left tile and belongs to the
/// leftmost camera; the next tiles are to its right, then row by row upward. Tiles after the last
/// view (at the top right) are unused, so that a grid can hold any number of views, for example a
/// prime number or a strip of 1 x N.
struct QuiltLayout {
  int columns = 1;
  int rows = 1;
  /// Number of views, at most columns * rows; 0 = one per tile.
  int views = 0;
  /// Width / height of one view as displayed; absent = the aspect of a tile's pixels. Tiles may be
  /// squeezed.
  std::optional<double> aspect = std::nullopt;
  double zoom = 1.0;  ///< as ViewCrop has it

  [[nodiscard]] int view_count() const { return views > 0 ? views : columns * rows; }
  friend bool operator==(const QuiltLayout&, const QuiltLayout&) = default;
};

/// Throws Error(Usage), its message starting with `context`, for a layout that no picture can have.
void check_quilt_layout(const QuiltLayout& layout, const std::string& context);

/// Parses the layout in a file's name, "city_qs8x6v45a0.75z1.2.png": 8 columns, 6 rows, 45 views,
/// aspect 0.75 (or 3:4) and zoom 1.2, all but the first two optional. The last valid layout of a
/// name counts; the rest of the name is ignored. Returns nothing if the name has no layout or an
/// invalid one.
[[nodiscard]] std::optional<QuiltLayout> quilt_layout_of_name(const std::filesystem::path& file);

struct TileSize {
  int width = 0;
  int height = 0;
};
/// Returns the size of a quilt's tiles: whole pixels from the bottom-left corner on. Throws
/// Error(Input) if a tile would have no pixel, Error(Usage) for an invalid layout.
[[nodiscard]] TileSize tile_size(const FrameGeometry& quilt, const QuiltLayout& layout,
                                 const std::string& name = "quilt");

/// Disparity is how far a point moves to the left from the leftmost view to the rightmost: positive
/// in front of the panel.
struct Disparity {
  double value = 0.0;
  bool in_pixels = false;  ///< pixels of a view; otherwise fractions of its width
  [[nodiscard]] double pixels(int width) const { return in_pixels ? value : value * width; }
  friend bool operator==(const Disparity&, const Disparity&) = default;
};

/// ViewCrop selects a part of each view: whole pixels, of the same size in all views.
struct ViewCrop {
  /// Keeps the middle 1 / zoom, at least 1 / 16. Values below 1 count as 1.
  double zoom = 1.0;
  Disparity zero_plane = {};  ///< points of this disparity are at one place in all parts
  friend bool operator==(const ViewCrop&, const ViewCrop&) = default;
};
/// Returns the size of the parts. Throws Error(Usage) if nothing would be left.
[[nodiscard]] TileSize cropped_size(const TileSize& view, const ViewCrop& crop);

/// ViewSet holds views of equal size and their pixels. Immutable.
///
/// Thread safety: any thread.
class ViewSet {
 public:
  /// Divides a quilt into tiles. Tiles are whole pixels from the bottom-left corner on; a remainder
  /// stays unused at the right and the top. Throws Error(Input) if a tile would have no pixel,
  /// Error(Usage) for an invalid layout.
  ViewSet(WovenFrame quilt, const QuiltLayout& layout, const std::string& name = "quilt");
  /// Divides a borrowed quilt.
  ///
  /// Lifetime: the quilt's pixels must outlive the set.
  [[nodiscard]] static ViewSet borrow(const FrameView& quilt, const QuiltLayout& layout,
                                      const std::string& name = "quilt");
  /// Borrows one picture per view. Throws Error(Input) when empty, or when sizes differ.
  ///
  /// Lifetime: the pictures must outlive the set.
  [[nodiscard]] static ViewSet borrow(std::span<const FrameView> views,
                                      std::optional<double> aspect = std::nullopt);
  /// Takes one picture per view. Throws Error(Input) when empty, or when sizes differ.
  explicit ViewSet(std::vector<WovenFrame> views, std::optional<double> aspect = std::nullopt);

  /// Returns the same pictures in reverse order: the last picture becomes the leftmost camera's.
  [[nodiscard]] ViewSet reversed() &&;
  /// Returns the parts of the views, with their aspect. Throws the Error of cropped_size().
  [[nodiscard]] ViewSet cropped(const ViewCrop& crop) &&;

  [[nodiscard]] int count() const { return static_cast<int>(first_pixels_.size()); }
  [[nodiscard]] int width() const { return width_; }
  [[nodiscard]] int height() const { return height_; }
  /// Returns width / height of a view as displayed.
  [[nodiscard]] double aspect() const { return aspect_; }
  /// Returns the distance from one row of a view to the next.
  [[nodiscard]] size_t stride_bytes() const { return stride_bytes_; }

  /// Returns the RGB of a view's pixel; row 0 is the top one.
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
  std::vector<const uint8_t*> first_pixels_;  // first pixel of each view in pictures_
  size_t stride_bytes_ = 0;
  int width_ = 0;
  int height_ = 0;
  double aspect_ = 1.0;
};

/// Returns the aspect of a picture with pixels of that shape; empty for square pixels, which state
/// no aspect.
[[nodiscard]] std::optional<double> stated_aspect(const FrameGeometry& picture,
                                                  double pixel_aspect);

/// Memory limit of all views of one moment together, unless a caller sets a lower limit.
inline constexpr uint64_t kMostViewBytes = uint64_t{8} << 30;

/// Reads one picture per view, the leftmost camera's first. Throws Error(Input) for sizes that
/// differ or more than `most_bytes` of pixels; messages about the whole set begin with `name`.
/// Pictures are rotated as their tags state, and the shape of their pixels sets the aspect unless
/// `aspect` is given.
[[nodiscard]] ViewSet read_views(const std::vector<std::filesystem::path>& files,
                                 const std::string& name,
                                 std::optional<double> aspect = std::nullopt,
                                 uint64_t most_bytes = kMostViewBytes);

}  // namespace lenticule::frames
