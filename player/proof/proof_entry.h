// SPDX-License-Identifier: Apache-2.0
// ProofEntry is one entry of the proof of play in the journal. docs/play/report.md lists its
// fields. Other programs can write entries of the same kind, so the parser trusts no field.
//
// Thread safety: any thread.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

namespace lenticule::player {

/// The MESSAGE_ID of all entries.
inline constexpr const char* kProofMessageId = "b2a79d9bb7a94b0dbb48d11c4fec1786";

/// Exactness of a display that has no cable.
inline constexpr const char* kNoExactness = "-";

struct ProofEntry {
  enum class Event {
    Started,    ///< the item's first frame is displayed; all counts are 0
    Continues,  ///< counts since the previous entry, of a turn of more than ten minutes
    Ended,      ///< counts since the previous entry
  };
  Event event = Event::Started;
  std::string session;  ///< 32 hexadecimal digits, one number per start of the player
  uint64_t turn = 0;    ///< counts the turns of a session from 1
  std::string item;     ///< source as it was given
  std::string hash{};   ///< hash of the content; empty while it is not known
  std::string panel{};
  std::string exactness = kNoExactness;  ///< the worst since the previous entry
  int64_t from_us = 0;                   ///< time to which the counts begin; CLOCK_REALTIME
  int64_t until_us = 0;
  uint64_t frames = 0;         ///< frames that appeared on the panel
  uint64_t unseen = 0;         ///< frames that were sent while no panel displayed them
  uint64_t missed = 0;         ///< vblanks without the frame that was due, and late frames left out
  uint64_t damaged = 0;        ///< frames that could not be read, or only with errors
  uint64_t whole = 0;          ///< plays from the first frame to the last
  uint64_t interrupted = 0;    ///< plays that ended earlier or began later
  uint64_t heard_ms = 0;       ///< time in which the item's sound was heard
  uint64_t silent_ms = 0;      ///< time in which it was due, and could not be heard
  std::string sound_device{};  ///< the last one; empty if there was none, or the item has no sound
  std::string overlays{};      ///< words of those over its frames so far; empty: none
  uint64_t process_start = 0;  ///< see process_start_of()

  friend bool operator==(const ProofEntry&, const ProofEntry&) = default;
};

/// Returns the entry as fields "NAME=value" of the journal, with MESSAGE and PRIORITY.
[[nodiscard]] std::vector<std::string> journal_fields(const ProofEntry& entry);

/// Returns the names of the fields that parse_proof_entry() reads.
[[nodiscard]] std::vector<const char*> proof_field_names();
/// Parses fields "NAME=value"; unknown fields are ignored. Returns nothing if a field is missing,
/// too long or has a value that journal_fields() does not write.
[[nodiscard]] std::optional<ProofEntry> parse_proof_entry(
    const std::vector<std::string_view>& fields);

/// Returns the time at which a process was started, in clock ticks since the machine was: with its
/// number it identifies the process. 0 if there is no such process.
[[nodiscard]] uint64_t process_start_of(int64_t process);

}  // namespace lenticule::player
