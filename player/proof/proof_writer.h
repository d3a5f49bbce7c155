// SPDX-License-Identifier: Apache-2.0
// ProofWriter writes entries of the proof of play to the journal, on a thread of its own, so that a
// journal that does not respond cannot delay the player.
#pragma once

#include <functional>
#include <memory>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "player/process/detached_worker.h"
#include "player/proof/proof_entry.h"

namespace lenticule::player {

/// Thread safety: one thread.
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

}  // namespace lenticule::player
