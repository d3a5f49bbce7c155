// SPDX-License-Identifier: Apache-2.0
// Reads any lines as the fields of an entry of the proof of play. An accepted entry is read as it
// is written, and can be reported.
#include <algorithm>
#include <string_view>
#include <vector>

#include "base/error.h"
#include "player/proof/proof_report.h"

using namespace lenticule::player;

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  std::string_view text(reinterpret_cast<const char*>(data), size);
  std::vector<std::string_view> fields;
  while (!text.empty()) {
    const size_t end = std::min(text.find('\n'), text.size());
    fields.push_back(text.substr(0, end));
    text.remove_prefix(std::min(end + 1, text.size()));
  }
  const auto entry = parse_proof_entry(fields);
  ProofReport report({.item = "*"});
  report.add({.proof = entry, .origin = {}});
  if (entry) {
    const std::vector<std::string> written = journal_fields(*entry);
    LENTICULE_CHECK(parse_proof_entry({written.begin(), written.end()}) == entry);
  }
  const ProofSummary summary = report.finish([](const auto&, const auto&) { return false; });
  LENTICULE_CHECK(summary.ignored == (entry ? 0u : 1u));
  LENTICULE_CHECK(table_text(summary).find('\x1b') == std::string::npos);
  LENTICULE_CHECK(csv_text(summary).find('\x1b') == std::string::npos);
  (void)to_json(summary).dump(-1, ' ', true, nlohmann::json::error_handler_t::replace);
  return 0;
}
