// SPDX-License-Identifier: Apache-2.0
#include "player/proof/proof_entry.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <fstream>
#include <iterator>
#include <utility>

#include "base/numbers.h"
#include "base/text.h"

namespace lenticule::player {
namespace {

using Event = ProofEntry::Event;

constexpr size_t kMaxItemBytes = 4096;
constexpr size_t kMaxTextBytes = 256;
constexpr size_t kSessionDigits = 32;
constexpr int64_t kLastTime = 253'402'300'800'000'000;  // the year 10000, in microseconds
constexpr uint64_t kMaxCount = 1'000'000'000'000'000;   // sums of many stay within 64 bits

constexpr std::array<std::pair<Event, const char*>, 3> kEvents = {
    {{Event::Started, "started"}, {Event::Continues, "continues"}, {Event::Ended, "ended"}}};

struct Text {
  const char* name;
  std::string ProofEntry::*member;
  size_t most_bytes;
};
constexpr std::array kTexts = std::to_array<Text>({
    {"LENTICULE_SESSION", &ProofEntry::session, kSessionDigits},
    {"LENTICULE_ITEM", &ProofEntry::item, kMaxItemBytes},
    {"LENTICULE_HASH", &ProofEntry::hash, kMaxTextBytes},
    {"LENTICULE_PANEL", &ProofEntry::panel, kMaxTextBytes},
    {"LENTICULE_EXACTNESS", &ProofEntry::exactness, kMaxTextBytes},
    {"LENTICULE_SOUND_DEVICE", &ProofEntry::sound_device, kMaxTextBytes},
    {"LENTICULE_OVERLAYS", &ProofEntry::overlays, kMaxItemBytes},
});

template <class Value>
struct Number {
  const char* name;
  Value ProofEntry::*member;
  bool may_be_missing = false;  ///< not written if it is 0
};
constexpr std::array kCounts = std::to_array<Number<uint64_t>>({
    {"LENTICULE_TURN", &ProofEntry::turn},
    {"LENTICULE_FRAMES_SHOWN", &ProofEntry::frames},
    {"LENTICULE_FRAMES_UNSEEN", &ProofEntry::unseen},
    {"LENTICULE_MISSED", &ProofEntry::missed},
    {"LENTICULE_DAMAGED", &ProofEntry::damaged},
    {"LENTICULE_PLAYS_WHOLE", &ProofEntry::whole},
    {"LENTICULE_PLAYS_INTERRUPTED", &ProofEntry::interrupted},
    {"LENTICULE_PROCESS_START", &ProofEntry::process_start},
    {"LENTICULE_SOUND_HEARD_MS", &ProofEntry::heard_ms, true},
    {"LENTICULE_SOUND_SILENT_MS", &ProofEntry::silent_ms, true},
});

constexpr std::array kTimes = std::to_array<Number<int64_t>>({
    {"LENTICULE_FROM_USEC", &ProofEntry::from_us},
    {"LENTICULE_UNTIL_USEC", &ProofEntry::until_us},
});
constexpr const char* kEventField = "LENTICULE_EVENT";

const char* name_of(Event event) {
  return std::ranges::find(kEvents, event, &std::pair<Event, const char*>::first)->second;
}

/// Cuts a text to the length that the parser accepts.
std::string within(const std::string& text, size_t bytes) {
  return text.size() <= bytes ? text : shortened(escaped(text), bytes);
}

std::string message_of(const ProofEntry& entry) {
  const std::string item = shortened(escaped(entry.item), 200);
  if (entry.event == Event::Started) return "proof of play: started " + item;
  return fmt::format(
      "proof of play: {} {}: {} whole, {} interrupted, {} frames, {} missed, {} damaged",
      name_of(entry.event), item, entry.whole, entry.interrupted, entry.frames, entry.missed,
      entry.damaged);
}

bool is_session(std::string_view text) {
  return text.size() == kSessionDigits &&
         text.find_first_not_of("0123456789abcdef") == std::string_view::npos;
}

bool is_plausible(const ProofEntry& entry) {
  const bool times =
      entry.from_us > 0 && entry.from_us <= entry.until_us && entry.until_us < kLastTime;
  bool counts = entry.turn > 0;
  for (const auto& count : kCounts) counts = counts && entry.*count.member <= kMaxCount;
  return times && counts && is_session(entry.session) && !entry.item.empty() &&
         !entry.panel.empty() && !entry.exactness.empty();
}

/// Returns the value of the field; none if it is missing.
std::optional<std::string_view> value_of(const std::vector<std::string_view>& fields,
                                         std::string_view name) {
  for (const std::string_view field : fields)
    if (field.size() > name.size() && field.starts_with(name) && field[name.size()] == '=')
      return field.substr(name.size() + 1);
  return std::nullopt;
}

}  // namespace

std::vector<std::string> journal_fields(const ProofEntry& entry) {
  std::vector<std::string> fields = {
      "MESSAGE=" + message_of(entry), std::string("MESSAGE_ID=") + kProofMessageId, "PRIORITY=6",
      "SYSLOG_IDENTIFIER=lenticule", std::string(kEventField) + "=" + name_of(entry.event)};
  for (const Text& text : kTexts)
    if (!(entry.*text.member).empty())
      fields.push_back(
          fmt::format("{}={}", text.name, within(entry.*text.member, text.most_bytes)));
  for (const auto& count : kCounts)
    if (!count.may_be_missing || entry.*count.member > 0)
      fields.push_back(fmt::format("{}={}", count.name, entry.*count.member));
  for (const auto& time : kTimes)
    fields.push_back(fmt::format("{}={}", time.name, entry.*time.member));
  return fields;
}

std::vector<const char*> proof_field_names() {
  std::vector<const char*> names = {kEventField};
  for (const Text& text : kTexts) names.push_back(text.name);
  for (const auto& count : kCounts) names.push_back(count.name);
  for (const auto& time : kTimes) names.push_back(time.name);
  return names;
}

std::optional<ProofEntry> parse_proof_entry(const std::vector<std::string_view>& fields) {
  ProofEntry entry;
  const std::string_view name = value_of(fields, kEventField).value_or("");
  const auto event = std::ranges::find(kEvents, name, &std::pair<Event, const char*>::second);
  if (event == kEvents.end()) return std::nullopt;
  entry.event = event->first;
  entry.exactness.clear();
  for (const Text& text : kTexts) {
    const std::string_view value = value_of(fields, text.name).value_or("");
    if (value.size() > text.most_bytes) return std::nullopt;
    entry.*text.member = value;
  }
  for (const auto& count : kCounts) {
    const auto text = value_of(fields, count.name);
    if (!text && count.may_be_missing) continue;
    const auto value = number_from<uint64_t>(text.value_or(""));
    if (!value) return std::nullopt;
    entry.*count.member = *value;
  }
  for (const auto& time : kTimes) {
    const auto value = number_from<int64_t>(value_of(fields, time.name).value_or(""));
    if (!value) return std::nullopt;
    entry.*time.member = *value;
  }
  if (!is_plausible(entry)) return std::nullopt;
  return entry;
}

uint64_t process_start_of(int64_t process) {
  constexpr int kFieldsAfterName = 20;  // the start is field 22, the name field 2
  std::ifstream file(fmt::format("/proc/{}/stat", process));
  const std::string text((std::istreambuf_iterator<char>(file)), {});
  const size_t name_end = text.rfind(')');  // the name may contain blanks and brackets
  if (name_end == std::string::npos) return 0;
  std::string_view rest = std::string_view(text).substr(name_end + 1);
  for (int field = 0; field < kFieldsAfterName; ++field) (void)take_until(rest, ' ');
  return take_number<uint64_t>(rest).value_or(0);
}

}  // namespace lenticule::player
