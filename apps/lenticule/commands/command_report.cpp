// SPDX-License-Identifier: Apache-2.0
// lenticule report sums what players have shown, from the entries in the journal.

#include <CLI/CLI.hpp>
#include <atomic>
#include <chrono>
#include <memory>
#include <optional>
#include <string>

#include "apps/lenticule/cli/command.h"
#include "apps/lenticule/cli/option.h"
#include "base/error_kinds.h"
#include "base/print.h"
#include "player/proof/content_hash.h"
#include "player/proof/proof_report.h"

namespace lenticule::cli {
namespace {

struct ReportFlags {
  std::string since;
  std::string until;
  std::string item;
  std::string hash_of;
  player::JournalPlace place;
  bool csv = false;
  bool json = false;
};

std::optional<int64_t> time_of(const char* flag, const std::string& text) {
  if (text.empty()) return std::nullopt;
  const auto now = std::chrono::system_clock::now().time_since_epoch();
  const auto time = player::parse_local_time(
      text, std::chrono::duration_cast<std::chrono::microseconds>(now).count());
  if (time) return time;
  throw usage_error("{} '{}': not a time", flag, text)
      .remedy("write 2026-11-25, \"2026-11-25 14:30\", today or yesterday; local time");
}

ExitCode print_hash(const std::string& source) {
  const std::string hash = content_hash(player::parse_source(source), std::atomic<bool>(false));
  if (hash.empty())
    throw usage_error("{}: has no hash, because it is not made of files", source)
        .remedy("use a sequence, a picture or a video");
  print_out("{}  {}\n", hash, source);
  return kOk;
}

ExitCode run_report(const ReportFlags& flags) {
  if (!flags.hash_of.empty()) return print_hash(flags.hash_of);
  player::ProofReport report({.since_us = time_of("--since", flags.since),
                              .until_us = time_of("--until", flags.until),
                              .item = flags.item});
  player::JournalPlace place = flags.place;
  place.since_us = time_of("--since", flags.since);
  read_proof(place, [&](const player::JournalEntry& entry) { report.add(entry); });
  const player::ProofSummary summary = report.finish(player::is_running);
  if (flags.json)
    print_out("{}\n", Verbatim{json_text(to_json(summary), 2)});
  else
    print_out("{}", Verbatim{flags.csv ? csv_text(summary) : table_text(summary)});
  const bool own_journal = place.folder.empty() && place.files.empty();
  if (own_journal && !player::may_read_system_journal())
    say("only the entries of this user are read: run as root, or as a member of the group "
        "systemd-journal, for those of services\n");
  return kOk;
}

}  // namespace

Run declare_report(CLI::App& app) {
  const auto flags = std::make_shared<ReportFlags>();
  add_option(app, "--since TIME", flags->since,
             "leave out what began before: 2026-11-25, '2026-11-25 14:30', today, yesterday");
  add_option(app, "--until TIME", flags->until, "leave out what began at this time or later");
  add_option(app, "--item GLOB", flags->item,
             "only items whose path or file name matches: 'wave*.lts'");
  add_option(app, "--unit UNIT", flags->place.unit,
             "only entries of this service, which other users cannot forge: "
             "lenticule-player@lobby");
  CLI::Option* const folder = add_option(app, "--directory FOLDER", flags->place.folder,
                                         "read this folder of journal files, of any machine");
  add_option(app, "--file FILE", flags->place.files, "read these journal files")->excludes(folder);
  CLI::Option* const csv = app.add_flag("--csv", flags->csv, "print comma-separated values");
  app.add_flag("--json", flags->json, "print everything as JSON")->excludes(csv);
  add_option(app, "--hash-of FILE", flags->hash_of,
             "print only the hash that a report has for this file: to compare films");
  return [flags] { return run_report(*flags); };
}

}  // namespace lenticule::cli
