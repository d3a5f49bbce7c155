// SPDX-License-Identifier: Apache-2.0
// Reads the entries of the proof of play from a journal.
#pragma once

#include <cstdint>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "player/proof/proof_report.h"

namespace lenticule::player {

struct JournalPlace {
  std::string folder{};              ///< folder of journal files; empty = the machine's journal
  std::vector<std::string> files{};  ///< journal files, in place of a folder
  std::string unit{};                ///< only entries of this unit; empty = all
  std::optional<int64_t> since_us{};
};

/// Calls `take` for each entry with the MESSAGE_ID of the proof of play, oldest first. Throws
/// Error(Input) for a journal that cannot be read.
void read_proof(const JournalPlace& place, const std::function<void(const JournalEntry&)>& take);

/// Returns true if the process that wrote the entry is still there: same machine start, same
/// process.
[[nodiscard]] bool is_running(const ProofEntry& entry, const ProofOrigin& origin);

/// Returns true if this user may read the entries of other users and of services.
[[nodiscard]] bool may_read_system_journal();

}  // namespace lenticule::player
