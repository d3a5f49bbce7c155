// SPDX-License-Identifier: Apache-2.0
// Reads any bytes as a list that a page sends, and as the output of a calibration.
#include <cstdint>
#include <nlohmann/json.hpp>
#include <string>

#include "apps/lenticule-web/api/photo_session.h"
#include "apps/lenticule-web/api/play_list.h"
#include "apps/lenticule-web/http/message.h"
#include "base/error.h"

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  using namespace lenticule::web;
  const std::string text(reinterpret_cast<const char*>(data), size);
  const auto list = nlohmann::ordered_json::parse(text, nullptr, false);
  try {
    const std::string toml = PlayList::list_toml(list);
    // Every text is quoted: a line begins with a key, a table or a comment that the server chose.
    for (size_t at = 0; at < toml.size(); ++at)
      if (at == 0 || toml[at - 1] == '\n')
        LENTICULE_CHECK(std::string("#\nfldscw[t").find(toml[at]) != std::string::npos);
  } catch (const lenticule::Error&) {
  }
  const CalibrationOutput output = parse_calibration_output(text);
  LENTICULE_CHECK(output.report.is_null() || output.report.is_object());
  for (const char c : output.message)
    LENTICULE_CHECK(c == '\n' || static_cast<unsigned char>(c) >= 0x20);
  return 0;
}
