// SPDX-License-Identifier: Apache-2.0
#include "apps/lenticule-web/http/message.h"

#include "base/text.h"

namespace lenticule::web {
namespace {

int status_of(const Error& error) {
  if (const auto* const http = dynamic_cast<const HttpError*>(&error)) return http->status();
  switch (error.kind()) {
    case ErrorKind::Usage:
      return 400;
    case ErrorKind::Device:
      return 502;
    case ErrorKind::Input:
      return 422;
    case ErrorKind::Failed:
    case ErrorKind::Quality:
      return 500;
  }
  return 500;
}

}  // namespace

Response json_response(const nlohmann::ordered_json& value, int status) {
  Response response;
  response.status = status;
  response.body = json_text(value) + "\n";
  return response;
}

Response error_response(int status, const std::string& cause, const std::string& remedy) {
  return json_response({{"error", {{"cause", cause}, {"remedy", remedy}}}}, status);
}

Response error_response(const Error& error) {
  return error_response(status_of(error), error.what(), error.hint());
}

}  // namespace lenticule::web
