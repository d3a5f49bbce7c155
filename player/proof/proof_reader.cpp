// SPDX-License-Identifier: Apache-2.0
#include "player/proof/proof_reader.h"

#include <fmt/format.h>
#include <grp.h>
#include <systemd/sd-id128.h>
#include <systemd/sd-journal.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cstring>
#include <memory>

#include "base/error.h"
#include "base/numbers.h"

namespace lenticule::player {
namespace {

using Journal = std::unique_ptr<sd_journal, decltype(&sd_journal_close)>;

constexpr size_t kMostFieldBytes = size_t{1} << 16;

void check(int result, const std::string& what) {
  if (result >= 0) return;
  throw Error(ErrorKind::Input, fmt::format("{}: {}", what, std::strerror(-result)),
              "name a folder of journal files, such as /var/log/journal/MACHINE");
}

Journal open_journal(const JournalPlace& place) {
  sd_journal* journal = nullptr;
  if (!place.files.empty()) {
    std::vector<const char*> names;
    for (const std::string& file : place.files) names.push_back(file.c_str());
    names.push_back(nullptr);
    check(sd_journal_open_files(&journal, names.data(), 0), place.files.front());
  } else if (!place.folder.empty()) {
    check(sd_journal_open_directory(&journal, place.folder.c_str(), 0), place.folder);
  } else {
    check(sd_journal_open(&journal, SD_JOURNAL_LOCAL_ONLY), "the journal of this machine");
  }
  return {journal, &sd_journal_close};
}

void select_entries(sd_journal* journal, const JournalPlace& place) {
  const auto match = [&](const std::string& field) {
    check(sd_journal_add_match(journal, field.data(), field.size()), field);
  };
  match(std::string("MESSAGE_ID=") + kProofMessageId);
  if (!place.unit.empty())
    match("_SYSTEMD_UNIT=" + place.unit +
          (place.unit.find('.') == std::string::npos ? ".service" : ""));
  check(sd_journal_set_data_threshold(journal, kMostFieldBytes), "the journal");
  if (place.since_us)
    check(sd_journal_seek_realtime_usec(journal, static_cast<uint64_t>(*place.since_us)),
          "the journal");
}

/// Returns the field "NAME=value" of the present entry; empty if it is missing.
std::string field_of(sd_journal* journal, const char* name) {
  const void* data = nullptr;
  size_t bytes = 0;
  if (sd_journal_get_data(journal, name, &data, &bytes) < 0) return {};
  return {static_cast<const char*>(data), bytes};
}

std::string value_of(sd_journal* journal, const char* name) {
  const std::string field = field_of(journal, name);
  return field.substr(std::min(field.size(), std::strlen(name) + 1));
}

ProofOrigin origin_of(sd_journal* journal) {
  return {.unit = value_of(journal, "_SYSTEMD_UNIT"),
          .user = value_of(journal, "_UID"),
          .program = value_of(journal, "_EXE"),
          .boot = value_of(journal, "_BOOT_ID"),
          .process = number_from<int64_t>(value_of(journal, "_PID")).value_or(0)};
}

JournalEntry entry_of(sd_journal* journal) {
  std::vector<std::string> fields;
  for (const char* const name : proof_field_names()) fields.push_back(field_of(journal, name));
  const std::vector<std::string_view> views(fields.begin(), fields.end());
  return {.proof = parse_proof_entry(views), .origin = origin_of(journal)};
}

}  // namespace

void read_proof(const JournalPlace& place, const std::function<void(const JournalEntry&)>& take) {
  const Journal journal = open_journal(place);
  select_entries(journal.get(), place);
  while (true) {
    const int more = sd_journal_next(journal.get());
    check(more, "the journal");
    if (more == 0) return;
    take(entry_of(journal.get()));
  }
}

bool is_running(const ProofEntry& entry, const ProofOrigin& origin) {
  sd_id128_t boot{};
  std::array<char, SD_ID128_STRING_MAX> text{};
  if (sd_id128_get_boot(&boot) < 0 || origin.boot != sd_id128_to_string(boot, text.data()))
    return false;
  return entry.process_start != 0 && process_start_of(origin.process) == entry.process_start;
}

bool may_read_system_journal() {
  if (::geteuid() == 0) return true;
  std::array<gid_t, 256> groups{};
  const int count = ::getgroups(static_cast<int>(groups.size()), groups.data());
  for (const char* const name : {"systemd-journal", "adm"}) {
    const group* const known = ::getgrnam(name);
    if (known != nullptr && count > 0 &&
        std::find(groups.begin(), groups.begin() + count, known->gr_gid) != groups.begin() + count)
      return true;
  }
  return false;
}

}  // namespace lenticule::player
