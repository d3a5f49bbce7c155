// SPDX-License-Identifier: Apache-2.0
// Entries need no place in the source.
#define SD_JOURNAL_SUPPRESS_LOCATION

#include "player/proof/proof_of_play.h"

#include <sys/uio.h>
#include <systemd/sd-id128.h>
#include <systemd/sd-journal.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <atomic>
#include <chrono>
#include <utility>

#include "base/error.h"
#include "base/print.h"
#include "player/proof/proof_report.h"

namespace lenticule::player {
namespace {

constexpr size_t kMostWaiting = 1000;
constexpr std::chrono::seconds kEndTimeout{2};

}  // namespace

struct ProofWriter::Counts {
  std::atomic<uint64_t> written{0};
  std::atomic<uint64_t> lost{0};
};

ProofWriter::ProofWriter(Send send)
    : send_(std::move(send)), counts_(std::make_shared<Counts>()), worker_(kMostWaiting) {}

ProofWriter::~ProofWriter() {
  if (!worker_.wait(kEndTimeout))
    say("proof of play: the journal does not respond; the last entries are lost\n");
}

void ProofWriter::write(const ProofEntry& entry) {
  const bool posted = worker_.post(
      [fields = journal_fields(entry), send = send_, counts = counts_](const auto& ending) {
        (void)ending;
        if (send(fields))
          ++counts->written;
        else if (counts->lost++ == 0)
          say("proof of play: the journal of this machine takes no entry; 'lost' in the statistics "
              "counts them\n");
      });
  if (!posted) ++counts_->lost;
}

nlohmann::ordered_json ProofWriter::statistics() const {
  return {{"entries", counts_->written.load()}, {"lost", counts_->lost.load()}};
}

bool send_to_journal(const std::vector<std::string>& fields) {
  // Without the journal's socket, sd_journal_sendv() reports success.
  if (::access("/run/systemd/journal/socket", F_OK) != 0) return false;
  std::vector<iovec> parts;
  parts.reserve(fields.size());
  for (const std::string& field : fields)
    parts.push_back({.iov_base = const_cast<char*>(field.data()), .iov_len = field.size()});
  return sd_journal_sendv(parts.data(), static_cast<int>(parts.size())) >= 0;
}

std::string new_proof_session() {
  sd_id128_t id{};
  if (sd_id128_randomize(&id) < 0)
    throw Error(ErrorKind::Failed, "proof of play: the kernel gives no random number");
  std::array<char, SD_ID128_STRING_MAX> text{};
  return sd_id128_to_string(id, text.data());
}

namespace {

using Event = ProofEntry::Event;

/// Time after which a turn gets a further entry, which limits what a power failure can lose.
constexpr uint64_t kLongestSpanNs = 600'000'000'000;

}  // namespace

ProofOfPlay::ProofOfPlay(ProofOptions options) : options_(std::move(options)) {}

void ProofOfPlay::update(TurnLog& turns, const ProofPanel& panel) {
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

void ProofOfPlay::begin(const ItemTurn& turn, const ProofPanel& panel) {
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

/// Adds what was displayed since the last call to the span, and begins the turn first if it is new.
void ProofOfPlay::count(const ItemTurn& turn, const ProofPanel& panel) {
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
  span.exactness = worse_exactness(span.exactness, panel.exactness);
  open.counted = turn;
}

void ProofOfPlay::count_last_play(const ItemTurn& turn) {
  const ItemAccount& account = open_->account;
  // A jump may come when the last frame is already displayed.
  const bool all_shown = turn.cut == 0 || turn.frames + turn.left_out >= account.handed_out;
  const bool whole = account.to_end && all_shown && !open_->spoiled;
  ++(whole ? open_->span.whole : open_->span.interrupted);
}

void ProofOfPlay::write(Event event, uint64_t until_ns) {
  ProofEntry& span = open_->span;
  span.event = event;
  span.hash = options_.hash(open_->account.source);
  span.from_us = options_.real_time(open_->span_from_ns);
  span.until_us = std::max(span.from_us, options_.real_time(until_ns));
  options_.write(span);
  span.frames = span.unseen = span.missed = span.damaged = span.whole = span.interrupted = 0;
  span.exactness = kNoExactness;
  open_->span_from_ns = until_ns;
}

std::function<int64_t(uint64_t)> monotonic_to_real_time() {
  return [](uint64_t display_ns) {
    using std::chrono::duration_cast;
    using std::chrono::microseconds;
    const auto real = std::chrono::system_clock::now().time_since_epoch();
    const auto since =
        std::chrono::steady_clock::now().time_since_epoch() - std::chrono::nanoseconds(display_ns);
    return duration_cast<microseconds>(real).count() - duration_cast<microseconds>(since).count();
  };
}

namespace {

ProofPanel panel_of(const display::Display& display, const display::KmsDisplay* kms) {
  ProofPanel panel{.name = display.mode().panel};
  if (kms == nullptr) return panel;
  const display::KmsStatistics statistics = kms->statistics();
  panel.exactness = display::verdict_name(kms->exactness().verdict);
  panel.away = statistics.off || statistics.panel != display::PanelState::Showing;
  return panel;
}

}  // namespace

PlayProof::PlayProof(ProofOptions::Account account)
    : writer_(send_to_journal),
      proof_({.session = new_proof_session(),
              .process_start = process_start_of(::getpid()),
              .write = [this](const ProofEntry& entry) { writer_.write(entry); },
              .account = std::move(account),
              .begin_hash = [this](const SourceSpec& source) { hashes_.request(source); },
              .hash = [this](const SourceSpec& source) { return hashes_.of(source); },
              .real_time = monotonic_to_real_time()}) {}

void PlayProof::update(const display::Display& display, const display::KmsDisplay* kms, bool lost) {
  if (!turns_) return;
  ProofPanel panel = panel_of(display, kms);
  panel.away |= lost;
  proof_.update(*turns_, panel);
}

nlohmann::ordered_json PlayProof::statistics() const {
  nlohmann::ordered_json statistics = writer_.statistics();
  statistics["turns_lost"] = turns_ ? turns_->lost() : 0;
  return statistics;
}

}  // namespace lenticule::player
