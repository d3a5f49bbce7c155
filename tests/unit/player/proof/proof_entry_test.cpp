// SPDX-License-Identifier: Apache-2.0
#include "player/proof/proof_entry.h"

#include <unistd.h>

#include "tests/unit/player/proof/proof_samples.h"

namespace lenticule::player {
namespace {

using test::whole_play;

ProofEntry full_entry() {
  ProofEntry entry = whole_play(3, "film/=wave\n\xff.lts");
  entry.unseen = 4;
  entry.missed = 5;
  entry.damaged = 6;
  entry.interrupted = 7;
  entry.heard_ms = 8;
  entry.silent_ms = 9;
  entry.sound_device = "plughw:0,3";
  entry.overlays = "picture logo.png, top; text Room 2, bottom";
  return entry;
}

std::optional<ProofEntry> parsed(const std::vector<std::string>& fields) {
  return parse_proof_entry({fields.begin(), fields.end()});
}

/// Returns the fields with that of `name` replaced; an empty replacement removes it.
std::vector<std::string> with(const std::string& name, const std::string& replacement) {
  std::vector<std::string> fields = journal_fields(full_entry());
  std::erase_if(fields, [&](const auto& field) { return field.starts_with(name + "="); });
  if (!replacement.empty()) fields.push_back(replacement);
  return fields;
}

TEST(ProofEntry, IsReadAsItWasWritten) {
  for (const auto event :
       {ProofEntry::Event::Started, ProofEntry::Event::Continues, ProofEntry::Event::Ended}) {
    ProofEntry entry = full_entry();
    entry.event = event;
    EXPECT_EQ(parsed(journal_fields(entry)), entry);
  }
  ProofEntry unknown_hash = full_entry();
  unknown_hash.hash.clear();
  EXPECT_EQ(parsed(journal_fields(unknown_hash)), unknown_hash);
}

TEST(ProofEntry, SaysNothingOfSoundAndOverlaysThatAnItemDoesNotHave) {
  for (const std::string& field : journal_fields(whole_play(1, "a.lts"))) {
    EXPECT_FALSE(field.starts_with("LENTICULE_SOUND_")) << field;
    EXPECT_FALSE(field.starts_with("LENTICULE_OVERLAYS")) << field;
  }
}

TEST(ProofEntry, HasAMessageForPeopleInOneLine) {
  const std::string message = journal_fields(full_entry()).front();
  EXPECT_EQ(message,
            "MESSAGE=proof of play: ended film/=wave\\x0a\\xff.lts: 1 whole, 7 interrupted, 24 "
            "frames, 5 missed, 6 damaged");
}

TEST(ProofEntry, RefusesEachMissingField) {
  for (const std::string name : proof_field_names()) {
    const bool may_be_missing = name == "LENTICULE_HASH" || name == "LENTICULE_OVERLAYS" ||
                                name.starts_with("LENTICULE_SOUND_");
    EXPECT_EQ(parsed(with(name, "")).has_value(), may_be_missing) << name;
  }
}

TEST(ProofEntry, RefusesWrongValues) {
  for (const std::string field :
       {"LENTICULE_EVENT=began", "LENTICULE_SESSION=xyz",
        "LENTICULE_SESSION=0123456789ABCDEF0123456789abcdef", "LENTICULE_ITEM=", "LENTICULE_TURN=0",
        "LENTICULE_TURN=-1", "LENTICULE_FRAMES_SHOWN=1e9", "LENTICULE_FRAMES_SHOWN=24 ",
        "LENTICULE_FRAMES_SHOWN=18446744073709551616", "LENTICULE_MISSED=1000000000000001",
        "LENTICULE_SOUND_HEARD_MS=1.5", "LENTICULE_SOUND_SILENT_MS=1000000000000001",
        "LENTICULE_FROM_USEC=0", "LENTICULE_UNTIL_USEC=5",
        "LENTICULE_UNTIL_USEC=9223372036854775807"}) {
    EXPECT_FALSE(parsed(with(field.substr(0, field.find('=')), field))) << field;
  }
  EXPECT_FALSE(parsed(with("LENTICULE_ITEM", "LENTICULE_ITEM=" + std::string(5000, 'x'))));
  EXPECT_FALSE(parsed({}));
}

TEST(ProofEntry, ShortensAnItemThatTheParserWouldRefuse) {
  ProofEntry entry = full_entry();
  entry.item = std::string(5000, '\n');
  const auto read = parsed(journal_fields(entry));
  ASSERT_TRUE(read);
  EXPECT_TRUE(read->item.starts_with("\\x0a\\x0a"));
  EXPECT_TRUE(read->item.ends_with("..."));
}

TEST(ProcessStart, IdentifiesARunningProcess) {
  const uint64_t own = process_start_of(::getpid());
  EXPECT_GT(own, 0u);
  EXPECT_EQ(process_start_of(::getpid()), own);
  EXPECT_NE(process_start_of(1), 0u);
  EXPECT_EQ(process_start_of(0), 0u);
  EXPECT_EQ(process_start_of(-1), 0u);
}

}  // namespace
}  // namespace lenticule::player
