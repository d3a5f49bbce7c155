// SPDX-License-Identifier: Apache-2.0
#include "apps/lenticule-bench/render/bench_error_pictures.h"

#include <fmt/format.h>

#include <algorithm>
#include <cctype>
#include <filesystem>

#include "frames/compare.h"
#include "frames/image_io.h"

namespace lenticule::bench {
namespace {

constexpr int kTileSide = 96;
constexpr size_t kPlaces = 3;
constexpr int kPaneSide = 384;
constexpr int kGap = 8;
constexpr uint8_t kGapGrey = 96;

/// A part of a picture, in fractions of its size.
struct Part {
  double left, top, width, height;
};

Part part_of(const frames::Tile& tile, const frames::FrameGeometry& picture) {
  return {.left = static_cast<double>(tile.x) / picture.width,
          .top = static_cast<double>(tile.y) / picture.height,
          .width = static_cast<double>(tile.width) / picture.width,
          .height = static_cast<double>(tile.height) / picture.height};
}

/// Returns a part, magnified so that pixels stay squares with sharp edges.
frames::WovenFrame magnified(const frames::FrameView& picture, const Part& part, int width,
                             int height) {
  const auto place = [](double begin, double size, int index, int count, int pixels) {
    const double at = (begin + size * (index + 0.5) / count) * pixels;
    return std::clamp(static_cast<int>(at), 0, pixels - 1);
  };
  frames::WovenFrame pane({.width = width, .height = height});
  for (int j = 0; j < height; ++j) {
    const uint8_t* const row =
        picture.row(place(part.top, part.height, j, height, picture.geometry.height));
    for (int i = 0; i < width; ++i)
      std::copy_n(row + 3 * place(part.left, part.width, i, width, picture.geometry.width), 3,
                  pane.row(j) + 3 * i);
  }
  return pane;
}

void put(const frames::WovenFrame& pane, int x, int y, frames::WovenFrame& sheet) {
  for (int j = 0; j < pane.height(); ++j)
    std::copy_n(pane.row(j), pane.geometry().row_bytes(), sheet.row(y + j) + 3 * x);
}

void put_row(const frames::FrameView& reference, const frames::FrameView& test, const Part& part,
             int width, int height, int y, frames::WovenFrame& sheet) {
  const frames::WovenFrame a = magnified(reference, part, width, height);
  const frames::WovenFrame b = magnified(test, part, width, height);
  put(a, 0, y, sheet);
  put(b, width + kGap, y, sheet);
  put(frames::error_picture(a.view(), b.view()), 2 * (width + kGap), y, sheet);
}

/// Returns the eye for which the tile differs most.
int eye_of(const frames::Tile& tile, const frames::FrameGeometry& panel,
           const SeenPictures& reference, const SeenPictures& test) {
  const Part part = part_of(tile, panel);
  double worst = -1.0;
  int eye = 0;
  for (size_t e = 0; e < reference.size(); ++e) {
    const auto pane = [&](const frames::WovenFrame& seen) {
      return magnified(seen.view(), part, tile.width, tile.height);
    };
    const double mse =
        frames::compare_pictures(pane(reference[e]).view(), pane(test[e]).view()).total.mse();
    if (mse <= worst) continue;
    worst = mse;
    eye = static_cast<int>(e);
  }
  return eye;
}

/// Returns letters, digits, dots and dashes only: a file name that is valid on any system.
std::string file_name(std::string text) {
  for (char& c : text)
    if (!std::isalnum(static_cast<unsigned char>(c)) && c != '.' && c != '-') c = '-';
  return text;
}

}  // namespace

frames::WovenFrame tile_sheet(const frames::FrameView& reference, const frames::FrameView& test,
                              const frames::FrameView& seen_reference,
                              const frames::FrameView& seen_test, const frames::Tile& tile) {
  const int scale = std::max(1, kPaneSide / std::max(tile.width, tile.height));
  const int width = scale * tile.width;
  const int height = scale * tile.height;
  frames::WovenFrame sheet({.width = 3 * width + 2 * kGap, .height = 2 * height + kGap});
  std::ranges::fill(sheet.bytes(), kGapGrey);
  const Part part = part_of(tile, reference.geometry);
  put_row(reference, test, part, width, height, 0, sheet);
  put_row(seen_reference, seen_test, part, width, height, height + kGap, sheet);
  return sheet;
}

void WorstPlaces::add(int frame, const frames::FrameView& reference, const frames::FrameView& test,
                      const SeenPictures& seen_reference, const SeenPictures& seen_test) {
  for (const frames::Tile& tile :
       frames::worst_tiles(reference, test, kTileSide, static_cast<int>(kPlaces))) {
    const auto here = [&](const Place& place) { return place.tile.overlaps(tile); };
    if (std::ranges::any_of(
            places_, [&](const Place& place) { return here(place) && place.tile.mse >= tile.mse; }))
      continue;
    std::erase_if(places_, here);
    const int eye = eye_of(tile, reference.geometry, seen_reference, seen_test);
    const auto e = static_cast<size_t>(eye);
    places_.push_back(
        {tile, frame, eye,
         tile_sheet(reference, test, seen_reference[e].view(), seen_test[e].view(), tile)});
  }
  std::ranges::stable_sort(places_, std::ranges::greater(),
                           [](const Place& place) { return place.tile.mse; });
  if (places_.size() > kPlaces) places_.erase(places_.begin() + kPlaces, places_.end());
}

nlohmann::json WorstPlaces::write(const std::string& folder, const std::string& stem) const {
  nlohmann::json written = nlohmann::json::array();
  if (!places_.empty()) std::filesystem::create_directories(folder);
  for (size_t n = 0; n < places_.size(); ++n) {
    const Place& place = places_[n];
    const std::filesystem::path file =
        std::filesystem::path(folder) / fmt::format("{}-{}.png", file_name(stem), n + 1);
    frames::write_woven(place.sheet.view(), file);
    written.push_back({{"file", file.string()},
                       {"frame", place.frame},
                       {"x", place.tile.x},
                       {"y", place.tile.y},
                       {"width", place.tile.width},
                       {"height", place.tile.height},
                       {"mse", place.tile.mse},
                       {"eye", place.eye}});
  }
  return written;
}

}  // namespace lenticule::bench
