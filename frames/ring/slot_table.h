// SPDX-License-Identifier: Apache-2.0
// SlotTable is the player's private slot table. It reads each value of the shared table once,
// checks the value against its own records, and never lets the shared table override them.
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "frames/frame_source.h"
#include "frames/ring/ring_layout.h"

namespace lenticule::frames {

enum class LoopKeeping {
  Off,  ///< a shown slot is free again
  On,   ///< slots keep their frames as long as the sequence fits the ring
};

/// RendererFate is the state of a renderer whose connection has ended.
enum class RendererFate {
  Dead,     ///< the process has exited and cannot write any more
  MayLive,  ///< the process may still be writing into the slot that it had taken
};

/// SlotTable tracks slots, sequences and epochs; sockets, files and processes are outside of its
/// scope. Allocates at construction only.
///
/// Thread safety: one thread.
class SlotTable {
 public:
  struct Frame {
    int slot = 0;
    uint64_t number = 0;
  };

  /// Offers every slot of `table`.
  ///
  /// Lifetime: `table` must outlive this object.
  SlotTable(std::span<SlotEntry> table, LoopKeeping keeping);

  // The functions below follow the connections of renderers.
  /// Returns the epoch of the connected renderer, or of the next one.
  [[nodiscard]] Epoch epoch() const { return epoch_; }
  /// Rewrites the words of the offered slots. Called between two connections.
  void renew_offers() noexcept;
  void begin_connection(std::optional<uint64_t> frame_count) noexcept;
  /// Takes over the frames that the renderer had published, then withdraws its slots. Returns the
  /// number of slots that stay shut until recover(), because the renderer may still be writing
  /// there.
  int end_connection(RendererFate fate) noexcept;
  /// Offers the shut slots of the renderer of `epoch` again, after its death.
  void recover(Epoch epoch) noexcept;
  /// Records the renderer's report that its `published` frames complete the sequence.
  void finish_sequence(uint64_t published) noexcept;
  /// Records that the renderer waits for a slot: a ring that is full of kept frames stops keeping
  /// them.
  void slot_wanted() noexcept;
  /// Takes over the frames published since the last call.
  void take_published() noexcept;
  /// Returns true if the connected renderer violated the protocol and must be disconnected.
  [[nodiscard]] bool misbehaved() const { return misbehaved_; }

  // The functions below hand out frames and take them back; see FrameSource.
  [[nodiscard]] PullStatus pull(Frame& out) noexcept;
  /// Returns true if the slot is free for the renderer again.
  bool release(int slot) noexcept;
  [[nodiscard]] bool rewind() noexcept;
  [[nodiscard]] uint64_t ready_count() const { return ready_.size(); }
  [[nodiscard]] bool saturated() const { return finished_ || offered_ == 0; }
  [[nodiscard]] int max_acquired() const { return static_cast<int>(slots_.size()) - 1; }

  // Statistics.
  [[nodiscard]] uint64_t accepted() const { return accepted_; }
  [[nodiscard]] uint64_t recovered() const { return recovered_; }
  [[nodiscard]] uint64_t violations() const { return violations_; }
  [[nodiscard]] int shut() const { return shut_; }
  [[nodiscard]] int acquired() const { return acquired_; }
  /// Returns the reason why rewind() cannot replay the present sequence; empty while it can (or may
  /// later).
  [[nodiscard]] std::string loop_obstacle() const;

 private:
  enum class Owner : uint8_t {
    Renderer,  ///< offered: free, being written, or published and not yet taken over
    Player,    ///< taken over: the frame belongs to the player until the slot is offered again
    None,      ///< shut: an earlier renderer may still be writing
  };
  struct Slot {
    Owner owner = Owner::Renderer;
    bool queued = false;  ///< waits in ready_
    bool kept = false;    ///< stays for rewind()
    int acquired = 0;   ///< number of acquisitions: a rewound frame can be acquired again while it
                        ///< is still displayed
    uint32_t word = 0;  ///< value that the player last wrote to the table
    Epoch epoch = 0;    ///< epoch of the renderer that the slot was offered to
    uint64_t number = 0;
    uint64_t sequence = 0;
  };
  /// Queue is a FIFO of slots that never contains a slot twice.
  class Queue {
   public:
    explicit Queue(size_t capacity) : slots_(capacity) {}
    [[nodiscard]] bool empty() const { return size_ == 0; }
    [[nodiscard]] size_t size() const { return size_; }
    [[nodiscard]] int front() const { return slots_[head_]; }
    void push(int slot) { slots_[(head_ + size_++) % slots_.size()] = slot; }
    void pop() {
      head_ = (head_ + 1) % slots_.size();
      --size_;
    }

   private:
    std::vector<int> slots_;
    size_t head_ = 0;
    size_t size_ = 0;
  };
  enum class Search { Found, NothingNew, LaterOnly, Broken };
  enum class LoopState { Off, Keeping, TooLong };

  void violated(Epoch by) noexcept;
  [[nodiscard]] Search find_next_published(int& found) noexcept;
  [[nodiscard]] bool take_next() noexcept;
  void take_over(int slot) noexcept;
  void withdraw(int slot, Epoch old_epoch, RendererFate fate) noexcept;
  void offer(int slot) noexcept;
  bool offer_if_idle(int slot) noexcept;
  void set_word(int slot, SlotState state) noexcept;
  void begin_sequence() noexcept;
  void stop_keeping(LoopState reason) noexcept;
  void acquire(Frame& out) noexcept;

  std::span<SlotEntry> table_;
  LoopKeeping keeping_;
  std::vector<Slot> slots_;
  Queue ready_;
  std::vector<int> kept_;  ///< slots of the present sequence in order

  Epoch epoch_ = 1;
  bool connected_ = false;
  bool misbehaved_ = false;
  uint64_t next_order_ = 0;
  std::optional<uint64_t> last_number_;
  int cursor_ = 0;  ///< next slot to examine: correct renderers use the slots in cyclic order

  uint64_t receiving_ = 0;  ///< number of the sequence that renderers deliver
  uint64_t pulling_ = 0;    ///< number of the sequence that pull() returns
  bool finished_ = false;   ///< receiving_ is complete
  bool end_reported_ = false;
  LoopState loop_;

  int offered_ = 0;
  int shut_ = 0;
  int acquired_ = 0;
  uint64_t accepted_ = 0;
  uint64_t recovered_ = 0;
  uint64_t violations_ = 0;
};

}  // namespace lenticule::frames
