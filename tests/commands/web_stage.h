// SPDX-License-Identifier: Apache-2.0
// Starts `lenticule web` beside a player, sends it requests, and compares its answers with the
// description of the API.
#pragma once

#include <unistd.h>

#include <algorithm>
#include <fstream>
#include <map>
#include <memory>
#include <stdexcept>
#include <string>
#include <vector>

#include "apps/lenticule-web/api/routes.h"
#include "apps/lenticule-web/http/access.h"
#include "apps/lenticule-web/http/server.h"
#include "base/error.h"
#include "tests/commands/player_stage.h"
#include "tests/unit/web/http_client.h"

namespace lenticule::test {

/// Checks `value` against a schema of the description; adds differences to `wrong`.
inline void compare(const nlohmann::ordered_json& value, const nlohmann::ordered_json& schema,
                    const nlohmann::ordered_json& description, const std::string& place,
                    std::string& wrong) {
  if (schema.contains("$ref")) {
    const auto name = schema["$ref"].get<std::string>();
    return compare(value, description["components"]["schemas"][name.substr(name.rfind('/') + 1)],
                   description, place, wrong);
  }
  if (value.is_null() && schema.value("nullable", false)) return;
  if (schema.contains("allOf"))
    return compare(value, schema["allOf"][0], description, place, wrong);
  if (!schema.contains("type")) return;
  const auto type = schema["type"].get<std::string>();
  const bool fits =
      (type == "object" && value.is_object()) || (type == "array" && value.is_array()) ||
      (type == "string" && value.is_string()) || (type == "integer" && value.is_number_integer()) ||
      (type == "number" && value.is_number()) || (type == "boolean" && value.is_boolean());
  if (!fits) wrong += place + ": expected " + type + ", got " + value.dump().substr(0, 80) + "\n";
  if (!fits) return;
  if (schema.contains("enum") &&
      std::find(schema["enum"].begin(), schema["enum"].end(), value) == schema["enum"].end())
    wrong += place + ": " + value.dump() + " is not in the enumeration\n";
  if (type == "array" && schema.contains("items"))
    for (const nlohmann::ordered_json& one : value)
      compare(one, schema["items"], description, place + "[]", wrong);
  if (type != "object" || !schema.contains("properties")) return;
  for (const auto& required : schema.value("required", nlohmann::ordered_json::array())) {
    const auto key = required.get<std::string>();
    if (!value.contains(key)) wrong += place + ": no " + key + "\n";
  }
  for (const auto& [key, inner] : value.items()) {
    if (schema["properties"].contains(key))
      compare(inner, schema["properties"][key], description, place + "." + key, wrong);
    else if (&schema != &description && !schema["properties"].empty() && key != "saved" &&
             key != "advice" && key != "problem")
      wrong += place + ": undocumented " + key + "\n";
  }
}

class WebTest : public PlayerTest {
 protected:
  /// Asks seldom enough for the server's limit of requests.
  template <typename Condition>
  [[nodiscard]] static bool comes_true(const Condition& condition) {
    return test::comes_true(condition, std::chrono::milliseconds(100));
  }
  void SetUp() override {
    PlayerTest::SetUp();
    std::filesystem::create_directories(path("media"));
  }
  void start_web(const std::vector<std::string>& more = {}, const char* socket = "c.sock") {
    web_ = std::make_unique<BackgroundProcess>(
        joined({LENTICULE_PROGRAM, "web", "--socket", path(socket), "--state", path("state"),
                "--media", path("media"), "--listen", "127.0.0.1:" + std::to_string(port_)},
               more));
    ASSERT_TRUE(comes_true([&] { return HttpClient(port_).connected(); }));
    const auto tokens = web::read_tokens(path("state") + "/tokens.json");
    ASSERT_FALSE(tokens.empty()) << "another program listens at port " << port_;
    token_ = tokens.front().secret;
  }
  HttpAnswer ask(const std::string& method, const std::string& address,
                 const std::string& body = {},
                 std::map<std::string, std::string> headers = {}) const {
    headers["Authorization"] = "Bearer " + token_;
    // Longer than the server may take.
    return HttpClient(port_, "127.0.0.1", std::chrono::seconds(70))
        .ask(method, address, headers, body);
  }
  nlohmann::ordered_json api(const std::string& method, const std::string& address,
                             const std::string& body = {}) const {
    const HttpAnswer answer = ask(method, "/api/v1/" + address, body);
    EXPECT_EQ(answer.status, 200) << method << " " << address << " " << answer.body;
    return nlohmann::ordered_json::parse(answer.body, nullptr, false);
  }
  void connect() {
    ASSERT_TRUE(comes_true([&] { return api("GET", "state")["connected"] == true; }));
  }
  static nlohmann::ordered_json description() { return web::api_description(); }
  /// Returns a port that no other program uses, from a part of the ports below those that the
  /// kernel names, which a connection of another test could get before the server listens.
  static uint16_t free_port() {
    constexpr int kFirst = 20000, kPorts = 12000;
    for (int k = 0; k < kPorts; ++k) {
      const auto port = static_cast<uint16_t>(kFirst + (::getpid() + k) % kPorts);
      try {
        (void)web::listen_tcp({.host = "127.0.0.1", .port = port}, false);
        return port;
      } catch (const Error&) {
        continue;  // in use
      }
    }
    throw std::runtime_error("no port is free");
  }

  uint16_t port_ = free_port();
  std::string token_;
  std::unique_ptr<BackgroundProcess> web_;
};

}  // namespace lenticule::test
