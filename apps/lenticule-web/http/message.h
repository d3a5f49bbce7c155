// SPDX-License-Identifier: Apache-2.0
// Request, Response and the interfaces between the HTTP server and what it serves.
#pragma once

#include <fmt/format.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <cstdint>
#include <cstring>
#include <functional>
#include <memory>
#include <nlohmann/json.hpp>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "apps/lenticule-web/http/access.h"
#include "base/error.h"
#include "base/text.h"

namespace lenticule::web {

/// Text of a request: a value, or none. Thread safety: the request's thread.
using RequestText = std::function<std::optional<std::string>(const char* name)>;

struct Request {
  std::string method{};
  std::string path{};    ///< percent-decoded, without the query
  RequestText query{};   ///< argument of the query by its name
  RequestText header{};  ///< header by its name
  std::string body{};    ///< empty if a BodySink took it
  std::string peer{};    ///< address of the sender
  Identity sender{};
};

/// EventStream is an answer that continues until one side ends it. It returns the next text to
/// send; it waits at most ten seconds, and returns a comment if nothing happened. None ends the
/// answer.
using EventStream = std::function<std::optional<std::string>()>;

struct Response {
  int status = 200;
  std::string type = "application/json";
  std::string body{};
  std::string_view borrowed{};  ///< instead of `body`: text that outlives the server
  std::vector<std::pair<std::string, std::string>> headers{};
  EventStream events{};  ///< instead of `body`
};

/// BodySink takes the body of a request that is too large for memory. It is destroyed before the
/// answer is sent, or when the connection ends.
class BodySink {
 public:
  virtual ~BodySink() = default;
  /// Takes the next bytes. Throws Error to refuse the rest.
  virtual void take(std::span<const uint8_t> bytes) = 0;
  /// Returns the answer after the whole body. Throws Error.
  [[nodiscard]] virtual Response finish() = 0;
};

/// HttpError is an error with the status of its answer.
class HttpError : public Error {
 public:
  HttpError(int status, const std::string& what, std::string hint = {})
      : Error(ErrorKind::Failed, what, std::move(hint)), status_(status) {}
  [[nodiscard]] int status() const { return status_; }

 private:
  int status_;
};

/// Throws HttpError 507 or 500 for a file that could not be written, by errno.
[[noreturn]] inline void fail_to_write(const std::string& name) {
  throw HttpError(errno == ENOSPC || errno == EDQUOT ? 507 : 500,
                  fmt::format("{}: cannot be written: {}", name, std::strerror(errno)));
}
inline void write_all(int file, std::span<const uint8_t> bytes, const std::string& name) {
  while (!bytes.empty()) {
    const ssize_t written = ::write(file, bytes.data(), bytes.size());
    if (written < 0 && errno == EINTR) continue;
    if (written <= 0) fail_to_write(name);
    bytes = bytes.subspan(static_cast<size_t>(written));
  }
}

/// Site answers the requests of a server. Its functions may throw Error.
///
/// Thread safety: any number of threads at once.
class Site {
 public:
  virtual ~Site() = default;
  /// Returns the rights that the request needs; None for pages without content of this machine.
  [[nodiscard]] virtual Rights needed(const std::string& method, const std::string& path) const = 0;
  /// Returns the largest body in bytes that the request may have.
  [[nodiscard]] virtual uint64_t largest_body(const std::string& method,
                                              const std::string& path) const = 0;
  /// Returns the sink of the request's body; null if the body goes into Request::body.
  [[nodiscard]] virtual std::unique_ptr<BodySink> sink(const Request& request) = 0;
  [[nodiscard]] virtual Response answer(const Request& request) = 0;
};

// Read JSON of another program, which may have any form.

/// Returns a member of an object; null if there is none.
[[nodiscard]] inline const nlohmann::ordered_json& member(const nlohmann::ordered_json& object,
                                                          const char* key) {
  static const nlohmann::ordered_json none;
  if (!object.is_object()) return none;
  const auto found = object.find(key);
  return found != object.end() ? *found : none;
}
/// Returns the text of a member; empty if it has none.
[[nodiscard]] inline std::string text_in(const nlohmann::ordered_json& object, const char* key) {
  const nlohmann::ordered_json& value = member(object, key);
  return value.is_string() ? value.get<std::string>() : std::string();
}
/// Returns a number; none for another value.
[[nodiscard]] inline std::optional<double> number_of(const nlohmann::ordered_json& value) {
  return value.is_number() ? std::optional(value.get<double>()) : std::nullopt;
}
/// Returns a list; an empty one for another value.
[[nodiscard]] inline nlohmann::ordered_json list_in(const nlohmann::ordered_json& value) {
  return value.is_array() ? value : nlohmann::ordered_json::array();
}

/// Returns an answer with a JSON object.
[[nodiscard]] inline Response json_response(const nlohmann::ordered_json& value, int status = 200) {
  Response response;
  response.status = status;
  response.body = json_text(value) + "\n";
  return response;
}
/// Returns the answer to a request that failed: {"error": {"cause", "remedy"}}.
[[nodiscard]] inline Response error_response(int status, const std::string& cause,
                                             const std::string& remedy = {}) {
  return json_response({{"error", {{"cause", cause}, {"remedy", remedy}}}}, status);
}
/// Returns the answer with the status of an HttpError, otherwise with the one that suits its kind.
[[nodiscard]] inline Response error_response(const Error& error) {
  constexpr std::array kStatuses = {500, 400, 502, 422, 500};  // from Failed to Quality
  const auto* const http = dynamic_cast<const HttpError*>(&error);
  const int status =
      http != nullptr ? http->status() : kStatuses[static_cast<size_t>(error.kind()) - 1];
  return error_response(status, error.what(), error.hint());
}

}  // namespace lenticule::web
