// SPDX-License-Identifier: Apache-2.0
// RingPlayer is the player's end of the ring: it owns the shared memory, listens on a Unix socket,
// accepts one renderer after another, and never trusts the content of the shared memory.
#pragma once

#include <filesystem>
#include <functional>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "base/unique_fd.h"
#include "frames/frame_source.h"
#include "frames/ring/listen_socket.h"
#include "frames/ring/ring_layout.h"
#include "frames/ring/ring_protocol.h"
#include "frames/ring/slot_table.h"
#include "optics/trim.h"

namespace lenticule::frames {

enum class RingPrefault {
  AtStart,  ///< take all memory in open(), so that later there is neither a page fault nor a
            ///< shortage
  Lazily,   ///< take a slot's memory when it is first written
};

struct RingOptions {
  std::filesystem::path socket;  ///< created with mode 0600; our own stale socket is replaced
  FrameGeometry geometry;        ///< only Rgb8 is supported
  int slots = 8;  ///< 3 ... 4096; refused when they would need more than half of the free memory
  /// The rig that frames must be rendered for, as a text of optics::to_text(RigIdentity): a
  /// fingerprint, and the calibration that the rig is a trim of; empty = any rig. Frames for
  /// another trim of the same calibration are accepted too.
  std::string rig_fingerprint;
  /// Called with one sentence when a renderer with another trim is accepted, on the thread of
  /// pull().
  std::function<void(const std::string&)> on_other_trim = nullptr;
  /// Keep every frame of a sequence that fits the ring, so that rewind() works without a renderer.
  /// A sequence fits if it has at most `slots` frames. While the sequence may fit, shown frames
  /// stay in their slots. When the renderer requests one more slot than the ring has, slots are
  /// recycled from then on and rewind() returns false (RingStatistics::loop_obstacle has the
  /// reason).
  bool keep_for_loop = false;
  RingPrefault prefault = RingPrefault::AtStart;
};

struct RingStatistics {
  uint64_t renderers = 0;          ///< connections accepted so far
  uint64_t renderers_refused = 0;  ///< renderers that sent Hello and were refused
  uint64_t renderer_deaths = 0;    ///< renderers that disconnected without a Goodbye message
  uint64_t frames_accepted = 0;
  uint64_t slots_recovered = 0;  ///< half-written slots recovered from dead renderers
  uint64_t violations = 0;       ///< shared-memory states that a correct renderer never makes
  int slots = 0;
  int slots_shut = 0;  ///< slots still mapped by a disconnected renderer that may be writing
  bool renderer_connected = false;
  std::string renderer_name;  ///< name of the present or the last renderer
  uint32_t heartbeat = 0;     ///< changes while the connected renderer works or waits for a slot
  std::string loop_obstacle;  ///< reason why rewind() cannot work; empty if it may
};

/// RingMemory is the player's mapping of a ring: a sealed memfd, its header and table writable, its
/// slots read-only.
class RingMemory {
 public:
  /// Throws Error(Usage) for a geometry that no ring can have, Error(Failed) when the ring would
  /// need more than half of the free memory or the kernel refuses.
  RingMemory(const RingLayout& layout, RingPrefault prefault);

  [[nodiscard]] const RingLayout& layout() const { return layout_; }
  [[nodiscard]] int fd() const { return fd_.get(); }
  [[nodiscard]] RingHeader& header() const;
  [[nodiscard]] std::span<SlotEntry> table() const;
  /// Rewrites the constant fields.
  void restore_header() const { write_header(layout_, header()); }
  /// Returns the whole frame in a slot, with its present bytes.
  [[nodiscard]] FrameView frame(int slot) const;

 private:
  RingLayout layout_;
  UniqueFd fd_;
  Mapping control_;  ///< header and table
  Mapping pixels_;   ///< slots, read-only: the player cannot damage a frame
};

/// RingPlayer is a FrameSource over a ring.
///
/// Renderers connect and disconnect, one at a time; pull() reports sequences, not renderers:
/// - A renderer that dies without a Goodbye message leaves its sequence open: pull() returns the
///   published frames, then NotYet, and the next renderer continues the same sequence.
/// - A Goodbye message completes the sequence: once its frames are pulled, pull() returns End until
///   rewind() succeeds or the next renderer connects. The next renderer begins a new sequence, so
///   the caller should keep pulling after End (also after rewind() returned false). If the next
///   renderer connects before End was returned, End is returned once between the sequences.
/// - rewind() works with keep_for_loop, after End, for a sequence that fits, until a new sequence
///   begins. It also works while frames are acquired: such a frame may then be acquired once more.
/// - rate() and frame_count() are the values that the present or the last renderer stated.
/// pull() never returns Failed. release() and pull() make progress visible to the renderer at once;
/// service() handles connections and deaths.
///
/// Thread safety: one thread, except where FrameSource states otherwise.
class RingPlayer final : public FrameSource {
 public:
  /// Throws Error(Usage) for invalid options, Error(Failed) when memory or socket are unavailable,
  /// Error(Device) when another player listens on the socket.
  [[nodiscard]] static std::unique_ptr<RingPlayer> open(const RingOptions& options);

  [[nodiscard]] FrameGeometry geometry() const override { return memory_.layout().geometry; }
  [[nodiscard]] std::optional<Rate> rate() const override { return hello_.rate; }
  [[nodiscard]] std::optional<uint64_t> frame_count() const override { return hello_.frame_count; }
  [[nodiscard]] PullStatus pull(AcquiredFrame& out) override;
  void release(uint64_t token) override;
  [[nodiscard]] int max_acquired() const override { return slot_table_.max_acquired(); }
  [[nodiscard]] uint64_t ready_count() const override { return slot_table_.ready_count(); }
  [[nodiscard]] bool saturated() const override { return slot_table_.saturated(); }
  [[nodiscard]] bool rewind() override { return slot_table_.rewind(); }
  [[nodiscard]] int wake_fd() const override { return events_.get(); }
  [[nodiscard]] bool waits_for_others() const override { return true; }
  void service() override;
  [[nodiscard]] std::string failure() const override { return {}; }
  [[nodiscard]] RingStatistics statistics() const;

 private:
  /// Connection is the connection to the renderer.
  struct Connection {
    UniqueFd socket;
    UniqueFd published;  ///< eventfd; only armed edge-triggered and never read, because the peer
                         ///< can make reads of a shared description block
    UniqueFd process;    ///< pidfd
  };

  /// Departed is a renderer that has disconnected but may still be writing.
  struct Departed {
    Epoch epoch;
    UniqueFd process;
  };

  /// ConnectionState is the state of a connection after a message.
  enum class ConnectionState { Connected, SaidGoodbye, Lost };

  struct Refusal {
    RefuseReason reason;
    std::string text;
  };

  explicit RingPlayer(const RingOptions& options);
  [[nodiscard]] bool watch(int fd, uint32_t events) const noexcept;
  void clear_wake() const noexcept;
  void accept();
  void answer_handshakes();
  [[nodiscard]] bool answer(UniqueFd& socket);
  void answer_hello(UniqueFd socket, const Packet& packet);
  [[nodiscard]] std::optional<Refusal> reason_to_refuse(const UniqueFd& socket,
                                                        const Packet& packet,
                                                        RendererHello& hello) const;
  [[nodiscard]] bool is_rig_accepted(const RendererHello& hello) const;
  void report_other_trim(const RendererHello& hello) const;
  [[nodiscard]] std::optional<Refusal> admit(UniqueFd& socket, RendererHello hello);
  void serve_connection();
  [[nodiscard]] ConnectionState handle(const Packet& packet);
  void drop_if_malformed();
  void end_connection(ConnectionState why);
  void recover_departed();
  void send_freed() const noexcept;

  const RingOptions options_;
  const optics::RigIdentity rig_ = optics::parse_identity(options_.rig_fingerprint);
  RingMemory memory_;
  SlotTable slot_table_;
  ListenSocket listener_;
  UniqueFd events_;
  std::vector<UniqueFd> handshakes_;  ///< connections that have sent no message yet; oldest first
  std::optional<Connection> connection_;
  std::vector<Departed> departed_;
  RendererHello hello_{.name = {}, .rig_fingerprint = {}, .rate = {}, .frame_count = {}};
  uint64_t renderers_ = 0;
  uint64_t refused_ = 0;
  uint64_t deaths_ = 0;
};

}  // namespace lenticule::frames
