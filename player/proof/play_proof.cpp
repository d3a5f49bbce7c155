// SPDX-License-Identifier: Apache-2.0
#include "player/proof/play_proof.h"

#include <unistd.h>

#include <utility>

namespace lenticule::player {
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

void PlayProof::prepare(PlaybackOptions& options) {
  options.turns = &turns_.emplace();
}

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
