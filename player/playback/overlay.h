// SPDX-License-Identifier: Apache-2.0
// Overlays are pictures, texts, clocks and QR codes that a player draws over its frames.
// OverlaySpec is what a list or a user asks for, OverlaySet what is drawn.
#pragma once

#include <cstdint>
#include <ctime>
#include <functional>
#include <memory>
#include <nlohmann/json.hpp>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "base/error.h"
#include "frames/frame.h"

namespace lenticule::player {

/// The most overlays of an item, with those of its list.
inline constexpr size_t kMaxOverlays = 8;

struct OverlaySpec {
  enum class Kind { Picture, Text, Clock, Code };
  Kind kind = Kind::Picture;
  std::string content{};           ///< file, text, format of strftime(), or text of the QR code
  size_t place = 8;                ///< 0 is the top left, 2 the top right, 8 the bottom right
  std::optional<double> height{};  ///< part of the panel's height: of a picture, a line, a code
  double from_s = 0.0;             ///< content time after the item's first frame
  std::optional<double> for_s{};   ///< none: to the end

  friend bool operator==(const OverlaySpec&, const OverlaySpec&) = default;
};

/// Parses an object with the keys of [[overlay]] in a list. Throws Error(Usage) "KEY: cause".
[[nodiscard]] OverlaySpec parse_overlay(const nlohmann::json& keys);
/// Returns the keys that parse_overlay() reads.
[[nodiscard]] nlohmann::ordered_json overlays_json(std::span<const OverlaySpec> overlays);
/// Returns the overlay in words: "picture logo.png, bottom right". The text of a code may be
/// secret.
[[nodiscard]] std::string to_string(const OverlaySpec& overlay);

/// A part of a frame with its overlays, which replaces those pixels of the frame.
struct OverlayBox {
  frames::FrameView pixels;
  int left = 0, top = 0;  ///< place in the picture, as the viewer sees it
  size_t part = 0;        ///< panel of a wall

  /// Copies the pixels that lie within a picture whose first pixel is at (x, y).
  void copy_into(std::span<uint8_t> picture, const frames::FrameGeometry& size, int x = 0,
                 int y = 0) const noexcept;
};

/// An overlay for one panel.
struct Overlay {
  OverlaySpec spec;
  uint32_t bit = 1;  ///< stands for it in the masks of OverlaySet
  frames::FrameGeometry panel;
  size_t part = 0;
  frames::FrameGeometry size{};  ///< size of the box, at most that of `colours`
  frames::WovenFrame colours{};
  std::vector<uint8_t> alpha{};    ///< one value per pixel of `colours`
  frames::AlignedBytes blended{};  ///< empty for an opaque overlay
  int dot_px = 1;                  ///< side of a dot of the font
  size_t columns = 0;              ///< letters that fit the panel's width
  std::string written{};           ///< time that a clock shows
};

/// Thread safety: one thread at a time.
class OverlaySet {
 public:
  /// Reads pictures, which may take long. `panels` are the pictures of a frame: one, or one for
  /// each panel of a wall. Leaves out an overlay that cannot be drawn, and calls `left_out`; if
  /// that is null, throws Error(Input).
  OverlaySet(std::span<const OverlaySpec> overlays, std::span<const frames::FrameGeometry> panels,
             const std::function<void(const Error&)>& left_out = nullptr);

  /// Returns the overlays that are due, as a mask.
  [[nodiscard]] uint32_t due_at(double seconds) const noexcept;
  /// Adds the words of overlays.
  void add_words(uint32_t mask, std::vector<std::string>& words) const;
  /// Adds the boxes of overlays that are drawn over `frame` and the boxes before. They are valid
  /// until the next call. Does not allocate if `boxes` has room for all overlays and panels.
  void draw(const frames::FrameView& frame, uint32_t mask, std::time_t now,
            std::vector<OverlayBox>& boxes) noexcept;

 private:
  std::vector<Overlay> overlays_;
};

/// The overlays of one frame.
struct OverlayMoment {
  OverlaySet* set = nullptr;
  uint32_t due = 0;
  std::shared_ptr<OverlaySet> live = nullptr;  ///< over all items; null: none
  std::time_t time = 0;                        ///< time that clocks show

  [[nodiscard]] bool same_overlays(const OverlayMoment& other) const {
    return set == other.set && due == other.due && live == other.live;
  }
};

}  // namespace lenticule::player
