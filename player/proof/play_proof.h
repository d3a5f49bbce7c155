// SPDX-License-Identifier: Apache-2.0
// PlayProof connects the proof of play of a run with its playbacks and the journal.
#pragma once

#include <nlohmann/json.hpp>
#include <optional>

#include "display/kms/scanout/kms_display.h"
#include "player/playback/playback.h"
#include "player/proof/content_hash.h"
#include "player/proof/proof_of_play.h"
#include "player/proof/proof_writer.h"

namespace lenticule::player {

/// Thread safety: one thread.
class PlayProof {
 public:
  explicit PlayProof(ProofOptions::Account account);

  /// Sets the options of a playback whose items are recorded.
  void prepare(PlaybackOptions& options);
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
