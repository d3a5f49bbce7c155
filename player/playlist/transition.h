// SPDX-License-Identifier: Apache-2.0
// Transition makes the frames with which an item of a playlist follows another one.
//
// The last frame of the item that ends is held, and the frames of the next one begin at once, so
// that a transition changes neither the length of an item nor the time at which it begins. A
// cross-fade mixes the two; a fade through black shows first the held frame, darker and darker, and
// then the running ones, brighter and brighter. Step k of n, counted from 0, is at (k + 1) / (n +
// 1) of the way, so that none of them equals a frame before or after the transition.
//
// Light is added, subpixel by subpixel, and not codes. A table has the result of each code (a fade
// changes one frame), or of each pair of codes, for one step, so that a subpixel costs one look-up;
// all processors share the rows.
//
// The blended frames replace those of the source: pacing, copies to the panel, snapshots and proof
// of play treat them as any others.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <span>
#include <vector>

#include "base/error.h"
#include "base/parallel_rows.h"
#include "frames/frame.h"
#include "frames/srgb.h"
#include "player/playlist/playlist.h"

namespace lenticule::player {

/// Thread safety: one thread at a time. The loader makes it: new memory takes as long as a refresh.
class Transition {
 public:
  /// Number of blended frames that may be borrowed at a time: one for each of three scan-out
  /// buffers, which snapshots read, and the next.
  static constexpr int kMostAcquired = 4;

  Transition(const Playlist& list, const PlaylistItem& item, const frames::FrameGeometry& panel)
      : kind_(list.transition_to(item)),
        seconds_(item.transition_s.value_or(list.transition_s)),
        frames_(kMostAcquired + 1, {.bytes = frames::AlignedBytes(panel.frame_bytes())}) {}

  /// Returns the number of steps at this rate.
  [[nodiscard]] uint64_t steps(frames::Rate rate) const {
    return static_cast<uint64_t>(std::max(1.0, std::round(seconds_ * rate.hertz())));
  }
  /// Replaces `frame`, of the item that begins, by step `k` of `n`. Returns the number for
  /// release().
  [[nodiscard]] size_t blend(const frames::FrameView& held, uint64_t k, uint64_t n,
                             frames::FrameView& frame) {
    const auto blended = std::ranges::find(frames_, false, &Blended::is_acquired);
    LENTICULE_CHECK(blended != frames_.end());
    blended->is_acquired = true;
    const double way = std::min(1.0, static_cast<double>(k + 1) / static_cast<double>(n + 1));
    const bool crosses = kind_ == TransitionKind::Cross, darkens = !crosses && way <= 0.5;
    const double first = crosses ? 1.0 - way : darkens ? 1.0 - 2.0 * way : 0.0;
    const double second = crosses ? way : darkens ? 0.0 : 2.0 * way - 1.0;
    const frames::FrameView from = crosses || darkens ? held : frame;
    const frames::FrameView to = crosses ? frame : from;
    const std::array<double, 256>& light = frames::linear_of_codes();
    const size_t pairs = crosses ? codes_.size() : light.size();
    for (size_t pair = 0; pair < pairs; ++pair)
      codes_[pair] = frames::code_from_linear(first * light[pair >> 8] +
                                              (darkens ? first : second) * light[pair & 255]);
    std::span<uint8_t> room = blended->bytes;
    blended->parts.clear();
    for (size_t part = 0; part < from.parts.size(); ++part)
      blended->parts.push_back(blended_picture(from.parts[part], to.parts[part], room));
    if (from.parts.empty()) frame = blended_picture(from, to, room);
    frame.parts = blended->parts;
    return static_cast<size_t>(blended - frames_.begin());
  }
  void release(size_t number) { frames_.at(number).is_acquired = false; }

 private:
  struct Blended {
    frames::AlignedBytes bytes;
    std::vector<frames::FrameView> parts{};  ///< the panels of a wall; empty for one panel
    bool is_acquired = false;
  };

  /// Blends one picture into the first bytes of `room`, and removes these from it.
  [[nodiscard]] frames::FrameView blended_picture(const frames::FrameView& from,
                                                  const frames::FrameView& to,
                                                  std::span<uint8_t>& room) const {
    const std::span<uint8_t> out = room.first(from.bytes.size());
    room = room.subspan(out.size());
    for_rows(from.geometry.height, [this, &from, &to, out](int row) noexcept {
      const size_t bytes = from.geometry.row_bytes();
      const uint8_t *a = from.row(row), *b = to.row(row), *const codes = codes_.data();
      uint8_t* const to_row = out.data() + static_cast<size_t>(row) * bytes;
      const bool is_one = a == b;
#pragma GCC unroll 8
      for (size_t n = 0; n < bytes && is_one; ++n) to_row[n] = codes[a[n]];
#pragma GCC unroll 8
      for (size_t n = 0; n < bytes && !is_one; ++n)
        to_row[n] = codes[static_cast<size_t>(a[n]) << 8 | b[n]];
    });
    return {.geometry = from.geometry, .bytes = out};
  }

  TransitionKind kind_;
  double seconds_;
  std::vector<Blended> frames_;
  std::array<uint8_t, size_t{1} << 16>
      codes_{};  ///< result of held code * 256 + new code; of a fade, of one
};

}  // namespace lenticule::player
