// SPDX-License-Identifier: Apache-2.0
// Provides playlist items that are scripted sources, opened by name.
#pragma once

#include <atomic>
#include <map>
#include <memory>
#include <mutex>
#include <string>
#include <utility>
#include <vector>

#include "base/error.h"
#include "player/playlist/playlist_source.h"
#include "tests/support/fakes/fake_source.h"

namespace lenticule::test {

inline constexpr frames::FrameGeometry kItemSize{.width = 16, .height = 8};

/// Frame k of a source whose numbers begin at `base` has the pixels of numbered_frame(base + k).
class OffsetSource final : public PlainSource {
 public:
  OffsetSource(uint64_t base, FakeSourceScript script, bool count_at_end, bool waits,
               uint64_t loop_begin)
      : script_(std::move(script)),
        count_at_end_(count_at_end),
        waits_(waits),
        loop_begin_(loop_begin) {
    for (uint64_t k = 0; k < script_.frames; ++k)
      pixels_.push_back(numbered_frame(script_.geometry, base + k));
  }
  [[nodiscard]] frames::FrameGeometry geometry() const override { return script_.geometry; }
  [[nodiscard]] std::optional<frames::Rate> rate() const override { return script_.rate; }
  [[nodiscard]] std::optional<uint64_t> frame_count() const override {
    return count_at_end_ && position_ < script_.frames ? std::nullopt
                                                       : std::optional(script_.frames);
  }
  [[nodiscard]] frames::PullStatus pull(frames::AcquiredFrame& out) override {
    if (waits_) return frames::PullStatus::NotYet;
    if (script_.fails_after && pulled_ >= *script_.fails_after) return frames::PullStatus::Failed;
    if (position_ == script_.frames) return frames::PullStatus::End;
    out = {.frame = pixels_[position_].view(), .number = position_, .token = pulled_++};
    ++position_;
    return frames::PullStatus::Ready;
  }
  [[nodiscard]] int max_acquired() const override { return 100; }
  [[nodiscard]] uint64_t ready_count() const override { return script_.frames - position_; }
  [[nodiscard]] bool rewind() override {
    position_ = loop_begin_;
    return script_.can_rewind;
  }

 private:
  FakeSourceScript script_;
  bool count_at_end_, waits_;
  uint64_t loop_begin_;
  std::vector<frames::WovenFrame> pixels_;
  uint64_t position_ = 0;
  uint64_t pulled_ = 0;
};

struct FakeItem {
  uint64_t base = 0;
  FakeSourceScript script{.geometry = kItemSize};
  bool waits = false;         ///< no frame comes
  bool count_at_end = false;  ///< as of a video, whose end alone tells the number of its frames
  uint64_t loop_begin = 0;    ///< first frame of later rounds
};

/// A fake disk with the items of a list. Thread safety: any thread may call.
class FakeShelf {
 public:
  void put(const std::string& name, FakeItem item) {
    const std::lock_guard lock(mutex_);
    items_[name] = std::move(item);
  }
  [[nodiscard]] player::ItemOpener opener() {
    return [this](const player::PlaylistItem& wanted, uint64_t frame) {
      (void)frame;  // this source cannot begin at a later frame
      const std::lock_guard lock(mutex_);
      ++opened_;
      const auto found = items_.find(wanted.source.text);
      if (found == items_.end())
        throw Error(ErrorKind::Input, wanted.source.text + ": no such file", "look for it");
      player::OpenedSource opened;
      const FakeItem& item = found->second;
      opened.source = std::make_unique<OffsetSource>(item.base, item.script, item.count_at_end,
                                                     item.waits, item.loop_begin);
      return opened;
    };
  }
  [[nodiscard]] int opened() const { return opened_.load(); }

 private:
  std::mutex mutex_;
  std::map<std::string, FakeItem> items_;
  std::atomic<int> opened_{0};
};

[[nodiscard]] inline player::Playlist list_of(const std::vector<std::string>& names,
                                              uint64_t rounds = 1) {
  player::Playlist list{.name = "list", .items = {}, .standby = {}, .rounds = rounds};
  for (const std::string& name : names) {
    list.items.emplace_back();
    list.items.back().source = player::parse_source(name);
  }
  return list;
}

}  // namespace lenticule::test
