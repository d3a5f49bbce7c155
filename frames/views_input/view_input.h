// SPDX-License-Identifier: Apache-2.0
// Sets of views, one after the other, wherever they come from: the pictures of one or several
// sources, and how views lie in them.
#pragma once

#include <chrono>
#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "frames/frame_source.h"
#include "frames/views_input/view_arrangement.h"

namespace lenticule::frames {

/// One thread.
class ViewInput {
 public:
  /// Takes a picture of each source at a time. Throws Error(Input) where the sources tell that they
  /// have different numbers of frames.
  ViewInput(std::vector<std::unique_ptr<FrameSource>> pictures,
            std::unique_ptr<ViewArrangement> arrangement, std::string name);
  /// The same views once a round.
  explicit ViewInput(ViewSet still);
  ~ViewInput();
  ViewInput(const ViewInput&) = delete;
  ViewInput& operator=(const ViewInput&) = delete;

  [[nodiscard]] const ViewShape& shape() const { return shape_; }
  [[nodiscard]] std::optional<Rate> rate() const;
  /// Of one round, as far as it is known.
  [[nodiscard]] std::optional<uint64_t> frame_count() const;

  /// The pictures of the next set, once the last one was released. Never waits for a disk or a
  /// decoder.
  [[nodiscard]] PullStatus next();
  /// What lies in the pictures that next() made ready: good until release(). Drawing views may take
  /// long the first time they are asked for. Throws what the arrangement throws.
  [[nodiscard]] const ViewSet& views();
  [[nodiscard]] uint64_t number() const { return number_; }
  void release();

  /// After End: from the beginning again. False if that cannot be.
  [[nodiscard]] bool rewind();
  /// Until next() may have more, but not longer.
  void wait(std::chrono::milliseconds longest);
  [[nodiscard]] const std::string& failure() const { return failure_; }
  /// Of all sources together, so far. Safe from any thread.
  [[nodiscard]] FrameDamage damage() const;

 private:
  struct Stream {
    std::unique_ptr<FrameSource> source;
    std::optional<LentFrame> lent = std::nullopt;
    bool ended = false;
  };
  [[nodiscard]] PullStatus pull_all();
  [[nodiscard]] PullStatus fail(std::string why);

  std::vector<Stream> streams_;
  std::unique_ptr<ViewArrangement> arrangement_;
  std::string name_;
  ViewShape shape_;
  std::optional<ViewSet> views_;
  bool still_ = false;
  bool still_given_ = false;
  uint64_t number_ = 0;
  std::string failure_;
};

}  // namespace lenticule::frames
