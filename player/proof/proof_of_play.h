// SPDX-License-Identifier: Apache-2.0
// ProofOfPlay turns the turns on the display into entries of the proof of play: one when an item
// starts, one every ten minutes, and one when its turn ends.
#pragma once

#include <sys/uio.h>
#include <systemd/sd-id128.h>
#include <systemd/sd-journal.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <atomic>
#include <chrono>
#include <functional>
#include <memory>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "base/error.h"
#include "base/print.h"
#include "display/kms/scanout/kms_display.h"
#include "player/playback/play_statistics.h"
#include "player/playback/playback.h"
#include "player/playlist/playlist_reporter.h"
#include "player/process/detached_worker.h"
#include "player/proof/content_hash.h"
#include "player/proof/proof_entry.h"
#include "player/proof/proof_report.h"

namespace lenticule::player {

/// ProofWriter writes entries of the proof of play to the journal, on a thread of its own, so that
/// a journal that does not respond cannot delay the player. Thread safety: one thread.
class ProofWriter {
 public:
  /// Sends fields "NAME=value"; returns false if that fails.
  using Send = std::function<bool(const std::vector<std::string>& fields)>;

  explicit ProofWriter(Send send)
      : send_(std::move(send)), counts_(std::make_shared<Counts>()), worker_(kMostWaiting) {}
  /// Waits at most two seconds for entries that are not sent yet.
  ~ProofWriter() {
    if (!worker_.wait(kEndTimeout))
      say("proof of play: the journal does not respond; the last entries are lost\n");
  }

  /// Returns at once.
  void write(const ProofEntry& entry) {
    const bool posted = worker_.post([fields = journal_fields(entry), send = send_,
                                      counts = counts_](const auto& ending) {
      (void)ending;
      if (send(fields))
        ++counts->written;
      else if (counts->lost++ == 0)
        say("proof of play: the journal of this machine takes no entry; 'lost' in the statistics "
            "counts them\n");
    });
    if (!posted) ++counts_->lost;
  }
  /// Returns the numbers of entries that were sent and that were lost.
  [[nodiscard]] nlohmann::ordered_json statistics() const {
    return {{"entries", counts_->written.load()}, {"lost", counts_->lost.load()}};
  }

 private:
  static constexpr size_t kMostWaiting = 1000;
  static constexpr std::chrono::seconds kEndTimeout{2};

  struct Counts {
    std::atomic<uint64_t> written{0};
    std::atomic<uint64_t> lost{0};
  };
  Send send_;
  std::shared_ptr<Counts> counts_;
  DetachedWorker worker_;
};

/// Sends an entry to the journal of this machine. Returns false if the journal does not take it.
[[nodiscard]] inline bool send_to_journal(const std::vector<std::string>& fields) {
  // Without the journal's socket, sd_journal_sendv() reports success.
  if (::access("/run/systemd/journal/socket", F_OK) != 0) return false;
  std::vector<iovec> parts;
  parts.reserve(fields.size());
  for (const std::string& field : fields)
    parts.push_back({.iov_base = const_cast<char*>(field.data()), .iov_len = field.size()});
  return sd_journal_sendv(parts.data(), static_cast<int>(parts.size())) >= 0;
}
/// Returns a new random session number.
[[nodiscard]] inline std::string new_proof_session() {
  sd_id128_t id{};
  if (sd_id128_randomize(&id) < 0)
    throw Error(ErrorKind::Failed, "proof of play: the kernel gives no random number");
  std::array<char, SD_ID128_STRING_MAX> text{};
  return sd_id128_to_string(id, text.data());
}

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
  SoundAccount written_sound;
  bool spoiled = false;  ///< the play that goes on is not whole any more
  uint64_t span_from_ns = 0;
  ProofEntry span;  ///< counts since the last entry
};

/// Thread safety: one thread.
class ProofOfPlay {
 public:
  explicit ProofOfPlay(ProofOptions options) : options_(std::move(options)) {}

  /// Writes the entries of what has happened since the last call. Call it about once a second, when
  /// a turn begins or ends, and at the end of a playback.
  void update(TurnLog& turns, const ProofPanel& panel) {
    while (const auto ended = turns.take()) {
      count(*ended, panel);
      count_last_play(*ended);
      write(Event::Ended, ended->ended_ns);
      open_.reset();
    }
    const ItemTurn running = turns.running();
    if (running.turn == 0) return;
    count(running, panel);
    if (running.ended_ns - open_->span_from_ns >= kLongestSpanNs)
      write(Event::Continues, running.ended_ns);
  }

 private:
  using Event = ProofEntry::Event;

  /// Time after which a turn gets a further entry, which limits what a power failure can lose.
  static constexpr uint64_t kLongestSpanNs = 600'000'000'000;

  void begin(const ItemTurn& turn, const ProofPanel& panel) {
    OpenTurn& open = open_.emplace();
    open.counted = {.turn = turn.turn, .item = turn.item, .begun_ns = turn.begun_ns};
    open.account.source.text = "unknown";
    if (const auto account = options_.account(turn.item)) open.account = *account;
    open.spoiled = !open.account.from_start;
    open.span_from_ns = turn.begun_ns;
    open.span = {.session = options_.session,
                 .turn = ++turns_,
                 .item = open.account.source.text,
                 .panel = panel.name,
                 .exactness = panel.exactness,
                 .process_start = options_.process_start};
    options_.begin_hash(open.account.source);
    write(Event::Started, turn.begun_ns);
  }
  /// Adds what was displayed since the last call to the span, and begins the turn first if it is
  /// new.
  void count(const ItemTurn& turn, const ProofPanel& panel) {
    if (!open_ || open_->counted.turn != turn.turn) begin(turn, panel);
    OpenTurn& open = *open_;
    if (const auto account = options_.account(turn.item)) open.account = *account;
    ProofEntry& span = open.span;
    const uint64_t frames = turn.frames - open.counted.frames;
    (panel.away ? span.unseen : span.frames) += frames;
    open.spoiled |= panel.away;
    const uint64_t rounds = turn.rounds - open.counted.rounds;
    if (rounds > 0) {
      const uint64_t spoiled = panel.away ? rounds : open.spoiled ? 1 : 0;
      span.interrupted += spoiled;
      span.whole += rounds - spoiled;
      open.spoiled = panel.away;
    }
    span.missed += turn.missed - open.counted.missed;
    const uint64_t damage = open.account.damage.damaged + open.account.damage.missing;
    span.damaged += damage - std::min(damage, open.written_damage);
    open.written_damage = damage;
    if (const auto& sound = open.account.sound) {
      span.heard_ms += sound->heard_ms - open.written_sound.heard_ms;
      span.silent_ms += sound->silent_ms - open.written_sound.silent_ms;
      if (!sound->device.empty()) span.sound_device = sound->device;
      open.written_sound = *sound;
    }
    span.overlays = fmt::format("{}", fmt::join(open.account.overlays, "; "));
    span.exactness = worse_exactness(span.exactness, panel.exactness);
    open.counted = turn;
  }
  void count_last_play(const ItemTurn& turn) {
    const ItemAccount& account = open_->account;
    // A jump may come when the last frame is already displayed.
    const bool all_shown = turn.cut == 0 || turn.frames + turn.left_out >= account.handed_out;
    const bool whole = account.to_end && all_shown && !open_->spoiled;
    ++(whole ? open_->span.whole : open_->span.interrupted);
  }
  void write(Event event, uint64_t until_ns) {
    ProofEntry& span = open_->span;
    span.event = event;
    span.hash = options_.hash(open_->account.source);
    span.from_us = options_.real_time(open_->span_from_ns);
    span.until_us = std::max(span.from_us, options_.real_time(until_ns));
    options_.write(span);
    span.frames = span.unseen = span.missed = span.damaged = span.whole = span.interrupted = 0;
    span.heard_ms = span.silent_ms = 0;
    span.exactness = kNoExactness;
    open_->span_from_ns = until_ns;
  }

  const ProofOptions options_;
  uint64_t turns_ = 0;
  std::optional<OpenTurn> open_;
};

/// Returns ProofOptions::real_time for a display whose clock is CLOCK_MONOTONIC.
[[nodiscard]] inline int64_t monotonic_to_real_time(uint64_t display_ns) {
  using std::chrono::duration_cast;
  using std::chrono::microseconds;
  const auto real = std::chrono::system_clock::now().time_since_epoch();
  const auto since =
      std::chrono::steady_clock::now().time_since_epoch() - std::chrono::nanoseconds(display_ns);
  return duration_cast<microseconds>(real).count() - duration_cast<microseconds>(since).count();
}

/// PlayProof connects the proof of play of a run with its playbacks and the journal.
/// Thread safety: one thread.
class PlayProof {
 public:
  explicit PlayProof(ProofOptions::Account account)
      : writer_(send_to_journal),
        proof_({.session = new_proof_session(),
                .process_start = process_start_of(::getpid()),
                .write = [this](const ProofEntry& entry) { writer_.write(entry); },
                .account = std::move(account),
                .begin_hash = [this](const SourceSpec& source) { hashes_.request(source); },
                .hash = [this](const SourceSpec& source) { return hashes_.of(source); },
                .real_time = monotonic_to_real_time}) {}

  /// Sets the options of a playback whose items are recorded.
  void prepare(PlaybackOptions& options) { options.turns = &turns_.emplace(); }
  /// Writes what has happened. `kms` is the display if it is a KMS display, else null. A display
  /// that is `lost` shows nothing from now on.
  void update(const display::Display& display, const display::KmsDisplay* kms, bool lost = false) {
    if (!turns_) return;
    ProofPanel panel = panel_of(display, kms);
    panel.away |= lost;
    proof_.update(*turns_, panel);
  }
  [[nodiscard]] nlohmann::ordered_json statistics() const {
    nlohmann::ordered_json statistics = writer_.statistics();
    statistics["turns_lost"] = turns_ ? turns_->lost() : 0;
    return statistics;
  }

 private:
  static ProofPanel panel_of(const display::Display& display, const display::KmsDisplay* kms) {
    ProofPanel panel{.name = display.mode().panel};
    if (kms == nullptr) return panel;
    const display::KmsStatistics statistics = kms->statistics();
    panel.exactness = display::verdict_name(kms->exactness().verdict);
    panel.away = statistics.off || statistics.panel != display::PanelState::Showing;
    return panel;
  }

  ContentHashes hashes_;
  ProofWriter writer_;
  ProofOfPlay proof_;
  std::optional<TurnLog> turns_;  ///< the turns of the last playback
};

}  // namespace lenticule::player
