// SPDX-License-Identifier: Apache-2.0
// Reads any bytes as a request: the result is an Error, or a request whose numbers are within their
// limits. In both cases the answer is one line of JSON.
#include <cmath>

#include "player/control/control_protocol.h"

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  using namespace lenticule::player;
  nlohmann::json id;
  std::string answer;
  try {
    const ControlRequest request =
        parse_control_request({reinterpret_cast<const char*>(data), size}, id);
    LENTICULE_CHECK(!request.verb.empty());
    LENTICULE_CHECK(std::isfinite(request.offset_lenses.value_or(0.0)));
    LENTICULE_CHECK(request.speed_permille >= 100 && request.speed_permille <= 8000);
    LENTICULE_CHECK(request.seconds.value_or(1.0) > 0.0);
    LENTICULE_CHECK(!request.eye_mm || (*request.eye_mm)[2] > 0.0);
    LENTICULE_CHECK(request.source.size() <= 4096 && request.file.size() <= 4096);
    answer = answer_line(id, {{"source", request.source}});
  } catch (const lenticule::Error& error) {
    LENTICULE_CHECK(error.kind() == lenticule::ErrorKind::Usage);
    answer = error_line(id, error);
  }
  LENTICULE_CHECK(answer.find('\n') == answer.size() - 1);
  LENTICULE_CHECK(nlohmann::json::parse(answer)["id"] == id);
  return 0;
}
