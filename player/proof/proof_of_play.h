// SPDX-License-Identifier: Apache-2.0
// ProofOfPlay turns the turns on the display into entries of the proof of play: one when an item
// starts, one every ten minutes, and one when its turn ends.
#pragma once

#include <functional>
#include <memory>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <vector>

#include "display/kms/scanout/kms_display.h"
#include "player/playback/play_statistics.h"
#include "player/playback/playback.h"
#include "player/playlist/playlist_reporter.h"
#include "player/process/detached_worker.h"
#include "player/proof/content_hash.h"
#include "player/proof/proof_entry.h"

namespace lenticule::player {

/// ProofWriter writes entries of the proof of play to the journal, on a thread of its own, so that
/// a journal that does not respond cannot delay the player. Thread safety: one thread.
class ProofWriter {
 public:
  /// Sends fields "NAME=value"; returns false if that fails.
  using Send = std::function<bool(const std::vector<std::string>& fields)>;

  explicit ProofWriter(Send send);
  /// Waits at most two seconds for entries that are not sent yet.
  ~ProofWriter();
  ProofWriter(const ProofWriter&) = delete;
  ProofWriter& operator=(const ProofWriter&) = delete;

  /// Returns at once.
  void write(const ProofEntry& entry);
  /// Returns the numbers of entries that were sent and that were lost.
  [[nodiscard]] nlohmann::ordered_json statistics() const;

 private:
  struct Counts;
  Send send_;
  std::shared_ptr<Counts> counts_;
  DetachedWorker worker_;
};

/// Sends an entry to the journal of this machine. Returns false if the journal does not take it.
[[nodiscard]] bool send_to_journal(const std::vector<std::string>& fields);
/// Returns a new random session number.
[[nodiscard]] std::string new_proof_session();

/// The display as it is now.
struct ProofPanel {
  std::string name;  ///< identity of the panel
  std::string exactness = kNoExactness;
  bool away = false;  ///< no panel shows the frames that are sent: unplugged, or switched off
};

struct ProofOptions {
  std::string session;
  uint64_t process_start = 0;
  std::function<void(const ProofEntry&)> write;
  /// Returns the account of an item by its number.
  using Account = std::function<std::optional<ItemAccount>(uint64_t item)>;
  Account account;
  /// Begins to compute the hash of a source's content.
  std::function<void(const SourceSpec&)> begin_hash;
  /// Returns that hash; empty while it is not known.
  std::function<std::string(const SourceSpec&)> hash;
  /// Returns the time in microseconds (CLOCK_REALTIME) of a time of the display's clock.
  std::function<int64_t(uint64_t display_ns)> real_time;
};

/// OpenTurn is the turn of which no end was written yet.
struct OpenTurn {
  ItemTurn counted;  ///< the part that is in `span`
  ItemAccount account;
  uint64_t written_damage = 0;
  bool spoiled = false;  ///< the play that goes on is not whole any more
  uint64_t span_from_ns = 0;
  ProofEntry span;  ///< counts since the last entry
};

/// Thread safety: one thread.
class ProofOfPlay {
 public:
  explicit ProofOfPlay(ProofOptions options);

  /// Writes the entries of what has happened since the last call. Call it about once a second, when
  /// a turn begins or ends, and at the end of a playback.
  void update(TurnLog& turns, const ProofPanel& panel);

 private:
  void begin(const ItemTurn& turn, const ProofPanel& panel);
  void count(const ItemTurn& turn, const ProofPanel& panel);
  void count_last_play(const ItemTurn& turn);
  void write(ProofEntry::Event event, uint64_t until_ns);

  const ProofOptions options_;
  uint64_t turns_ = 0;
  std::optional<OpenTurn> open_;
};

/// Returns the function for ProofOptions::real_time of a display whose clock is CLOCK_MONOTONIC.
[[nodiscard]] std::function<int64_t(uint64_t)> monotonic_to_real_time();

/// PlayProof connects the proof of play of a run with its playbacks and the journal.
/// Thread safety: one thread.
class PlayProof {
 public:
  explicit PlayProof(ProofOptions::Account account);

  /// Sets the options of a playback whose items are recorded.
  void prepare(PlaybackOptions& options) { options.turns = &turns_.emplace(); }
  /// Writes what has happened. `kms` is the display if it is a KMS display, else null. A display
  /// that is `lost` shows nothing from now on.
  void update(const display::Display& display, const display::KmsDisplay* kms, bool lost = false);
  [[nodiscard]] nlohmann::ordered_json statistics() const;

 private:
  ContentHashes hashes_;
  ProofWriter writer_;
  ProofOfPlay proof_;
  std::optional<TurnLog> turns_;  ///< the turns of the last playback
};

}  // namespace lenticule::player
