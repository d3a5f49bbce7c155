// SPDX-License-Identifier: Apache-2.0
// Tests `lenticule web` as a process: the API as it describes itself, pages, events, metrics,
// tokens and flags.
#include <gtest/gtest.h>

#include <algorithm>
#include <cctype>
#include <map>
#include <set>
#include <sstream>

#include "apps/lenticule-web/api/routes.h"
#include "base/text.h"
#include "frames/qr/qr_code.h"
#include "tests/commands/web_films.h"
#include "tests/support/scratch_folder.h"

namespace lenticule::test {
namespace {

using nlohmann::ordered_json;

TEST_F(Web, TheDescriptionListsEveryAddressWithItsRights) {
  std::set<std::string> served, described;
  for (const web::Route& route : web::routes()) {
    served.insert(lower_case(route.method) + " " + route.path + " " +
                  web::rights_name(route.rights));
  }
  start_web();
  const HttpAnswer answer = HttpClient(port_).ask("GET", "/api/v1/openapi.json");
  ASSERT_EQ(answer.status, 200) << "also without a token";
  const ordered_json document = ordered_json::parse(answer.body);
  EXPECT_EQ(document, description());
  for (const auto& [address, methods] : document["paths"].items())
    for (const auto& [method, operation] : methods.items())
      described.insert(method + " " + address + " " + operation["x-rights"].get<std::string>());
  EXPECT_EQ(served, described);
  const std::string text = document.dump();
  const std::string begin = "\"#/components/";
  for (size_t at = text.find(begin); at != std::string::npos; at = text.find(begin, at + 1)) {
    const std::string pointer = text.substr(at + 2, text.find('"', at + 1) - at - 2);
    EXPECT_TRUE(document.contains(ordered_json::json_pointer(pointer))) << pointer;
  }
}

TEST_F(Web, EveryAnswerIsAsTheDescriptionSays) {
  serve();
  const ordered_json document = description();
  const std::map<std::string, std::string> bodies = {
      {"post /api/v1/seek", R"({"item": 1, "frame": 2})"},
      {"post /api/v1/interrupt", R"({"file": "b.lts"})"},
      {"post /api/v1/cue", R"({"item": 1, "then_back": true})"},
      {"post /api/v1/speed", R"({"factor": 2})"},
      {"post /api/v1/volume", R"({"db": -6})"},
      {"post /api/v1/power", R"({"to": "off"})"},
      {"post /api/v1/show", R"({"what": "content"})"},
      {"post /api/v1/trim", R"({"offset_by_lenses": 0.01})"},
      {"post /api/v1/trim/save", R"({"name": "noon"})"},
      {"post /api/v1/calibration/restore", R"({"number": 1})"},
      {"put /api/v1/media/{name}", "content"},
      {"put /api/v1/calibration/photograph", "no picture"},
  };
  // The panel of these tests is too small for the chart.
  const std::map<std::string, int> refusals = {
      {"post /api/v1/calibration/begin", 422},        {"put /api/v1/calibration/photograph", 409},
      {"get /api/v1/calibration/before.jpg", 404},    {"get /api/v1/calibration/after.jpg", 404},
      {"get /api/v1/calibration/rig.toml", 404},      {"post /api/v1/calibration/keep", 409},
      {"post /api/v1/media/{name}/restore", 404},     {"post /api/v1/calibration/restore", 404},
      {"delete /api/v1/calibration/photograph", 400},
  };
  std::string wrong;
  ordered_json list;
  for (const auto& [address, methods] : document["paths"].items()) {
    for (const auto& [method, operation] : methods.items()) {
      const std::string key = method + " " + address;
      if (key == "get /api/v1/events") continue;  // never ends: tested below
      std::string place = address;
      if (const size_t at = place.find("{name}"); at != std::string::npos)
        place.replace(at, 6, method == "get" || key.ends_with("check") ? "a.lts" : "new.bin");
      if (key == "get /api/v1/eye.jpg") place += "?x=0&z=500&width=64";
      std::string body = bodies.contains(key) ? bodies.at(key) : "";
      if (key == "put /api/v1/list") body = list.dump();
      if (key == "post /api/v1/list/restore")
        body = R"({"name": ")" +
               api("GET", "list/versions")["versions"][0]["name"].get<std::string>() + "\"}";
      if (key == "post /api/v1/trim/restore") body = R"({"number": 1})";
      std::string upper = method;
      std::transform(upper.begin(), upper.end(), upper.begin(),
                     [](unsigned char c) { return static_cast<char>(std::toupper(c)); });
      const HttpAnswer answer = ask(upper, place, body);
      const ordered_json responses = operation["responses"];
      const std::string status = std::to_string(answer.status);
      const bool is_expected =
          refusals.contains(key) ? refusals.at(key) == answer.status : responses.contains(status);
      if (!is_expected) wrong += key + ": status " + status + " " + answer.body + "\n";
      ordered_json response = responses[responses.contains(status) ? status : "default"];
      if (response.contains("$ref"))
        response =
            document[ordered_json::json_pointer(response["$ref"].get<std::string>().substr(1))];
      if (!is_expected || !response.contains("content")) continue;
      const auto content = response["content"].items().begin();
      if (!answer.header("Content-Type").starts_with(content.key()))
        wrong += key + ": type " + answer.header("Content-Type") + "\n";
      if (content.key() != "application/json") continue;
      const ordered_json value = ordered_json::parse(answer.body, nullptr, false);
      compare(value, content.value()["schema"], document, key, wrong);
      if (key == "get /api/v1/list") {
        list = value;
        list.erase("file");
        list.erase("editable");
        list["items"][0]["loops"] = 7;
      }
    }
  }
  EXPECT_EQ(wrong, "");
  std::string errors;
  compare(ordered_json::parse(ask("POST", "/api/v1/seek", R"({"item": 99})").body),
          {{"$ref", "#/components/schemas/Error"}}, document, "error", errors);
  EXPECT_EQ(errors, "");
}

TEST_F(Web, PagesAreSmallAndReferToThisServerOnly) {
  start_web();
  for (const char* page : {"/", "/eye", "/trim", "/calibrate", "/health"}) {
    const HttpAnswer html = ask("GET", page);
    ASSERT_EQ(html.status, 200) << page;
    size_t bytes = html.body.size();
    EXPECT_EQ(html.body.find("://"), std::string::npos) << page << " names another server";
    EXPECT_EQ(html.body.find(" style="), std::string::npos);
    EXPECT_EQ(html.body.find(" onclick="), std::string::npos);
    for (const char* attribute : {"src=\"/", "href=\"/"})
      for (size_t at = html.body.find(attribute); at != std::string::npos;
           at = html.body.find(attribute, at + 1)) {
        const size_t begin = html.body.find('/', at);
        const std::string file = html.body.substr(begin, html.body.find('"', begin) - begin);
        if (file.find('.') == std::string::npos || file.starts_with("/api/")) continue;
        const HttpAnswer asset = HttpClient(port_).ask("GET", file);
        EXPECT_EQ(asset.status, 200) << file;
        EXPECT_EQ(asset.body.find("https://"), std::string::npos) << file;
        bytes += asset.body.size();
      }
    EXPECT_LT(bytes, 100'000u) << page;
    EXPECT_EQ(HttpClient(port_).ask("GET", page).status, 401) << "without a token";
  }
  const HttpAnswer style = ask("GET", "/style.css");
  EXPECT_EQ(ask("GET", "/style.css", {}, {{"If-None-Match", style.header("ETag")}}).status, 304);
}

TEST_F(Web, PathsLeadNowhereElse) {
  serve();
  write("secret.lts", "secret");
  for (const std::string name :
       {"..%2Fsecret.lts", "%2e%2e%2fsecret.lts", "../secret.lts", "..", ".", "%2Fetc%2Fpasswd",
        "a.lts%2F..%2F..%2Fsecret.lts", "..%5Csecret.lts", ".upload-a.lts", "list.toml", "%00",
        "a.lts%00.png", "%0a"})
    for (const char* method : {"GET", "PUT", "DELETE", "POST"}) {
      const std::string end = std::string(method) == "POST" ? "/check" : "";
      const HttpAnswer answer = ask(method, "/api/v1/media/" + name + end, "x");
      EXPECT_GE(answer.status, 400) << method << " " << name;
      EXPECT_EQ(answer.body.find("secret\""), std::string::npos);
    }
  EXPECT_EQ(ask("GET", "/../../etc/passwd").status, 404);
  EXPECT_EQ(ask("GET", "/page_files.cpp.css").status, 404);
  EXPECT_EQ(read_text(path("secret.lts")), "secret");
  // A link in the media folder is not followed.
  std::filesystem::create_symlink(path("secret.lts"), path("media/.upload-link.lts"));
  EXPECT_GE(ask("PUT", "/api/v1/media/link.lts", "overwritten").status, 400);
  EXPECT_EQ(std::filesystem::file_size(path("secret.lts")), 6u);
  const ordered_json list = api("GET", "list");
  const std::string outside = R"({"items": [{"source": ")" + path("secret.lts") + R"("}]})";
  EXPECT_EQ(ask("PUT", "/api/v1/list", outside).status, 422);
  const std::string pictured = R"({"overlay": [{"picture": ")" + path("secret.png") +
                               R"("}], "items": [{"source": "card"}]})";
  EXPECT_EQ(ask("PUT", "/api/v1/list", pictured).status, 422);
  const std::string heard = R"("sound": ")" + path("secret.wav") + R"(")";
  EXPECT_EQ(ask("PUT", "/api/v1/list", "{" + heard + R"(, "items": [{"source": "card"}]})").status,
            422);
  EXPECT_EQ(ask("PUT", "/api/v1/list", R"({"items": [{"source": "card", )" + heard + "}]}").status,
            422);
  EXPECT_EQ(api("GET", "list")["items"], list["items"]);
}

TEST_F(Web, EventsTellWhatChanges) {
  serve();
  HttpClient page(port_);
  page.say("GET /api/v1/events HTTP/1.1\r\nHost: a\r\nAuthorization: Bearer " + token_ +
           "\r\n\r\n");
  EXPECT_NE(page.hear_until("\"connected\":true").find("text/event-stream"), std::string::npos);
  (void)api("POST", "pause");
  EXPECT_NE(page.hear_until("\"state\":\"paused\"").find("event: state"), std::string::npos);
  (void)api("POST", "trim", R"({"offset_by_lenses": 0.01})");
  EXPECT_NE(page.hear_until("event: trim_changed").size(), 0u);
  (void)quit();
  EXPECT_NE(page.hear_until("\"connected\":false").find("event: state"), std::string::npos);
}

TEST_F(Web, MetricsHaveTheFormOfPrometheus) {
  serve({"--textfile", path("lenticule.prom")});
  std::string text;
  ASSERT_TRUE(comes_true([&] {
    text = ask("GET", "/metrics").body;
    return text.find("lenticule_vblanks_total ") != std::string::npos;
  }));
  std::istringstream lines(text);
  std::set<std::string> declared;
  for (std::string line; std::getline(lines, line);) {
    if (line.starts_with("# TYPE ")) declared.insert(line.substr(7, line.find(' ', 7) - 7));
    if (line.starts_with("#")) continue;
    const std::string name = line.substr(0, line.find_first_of("{ "));
    EXPECT_TRUE(declared.contains(name)) << line;
    const std::string value = line.substr(line.rfind(' ') + 1);
    size_t used = 0;
    EXPECT_NO_THROW((void)std::stod(value, &used)) << line;
    EXPECT_EQ(used, value.size()) << line;
  }
  EXPECT_NE(text.find("lenticule_up 1\n"), std::string::npos);
  EXPECT_NE(read_text(path("lenticule.prom")).find("lenticule_up"), std::string::npos);
  (void)quit();
  EXPECT_TRUE(comes_true(
      [&] { return ask("GET", "/metrics").body.find("lenticule_up 0\n") != std::string::npos; }));
}

TEST_F(Web, TokensAreAddedListedAndRevoked) {
  start_web();
  const ProcessResult added = run({"web", "token", "add", "guest", "--rights", "see", "--state",
                                   path("state"), "--base", "http://panel"});
  ASSERT_EQ(added.exit_code, 0) << added.err;
  ASSERT_TRUE(added.out.starts_with("http://panel/enter?token=")) << added.out;
  const std::string secret = added.out.substr(25, 32);
  const auto status = [&](const char* method, const char* address) {
    return HttpClient(port_).ask(method, address, {{"Authorization", "Bearer " + secret}}).status;
  };
  EXPECT_EQ(status("GET", "/"), 200) << "at once";
  EXPECT_EQ(status("POST", "/api/v1/pause"), 403);
  const ProcessResult list = run({"web", "token", "list", "--state", path("state")});
  EXPECT_EQ(list.out.find(secret), std::string::npos) << "ids, not secrets";
  const std::string row = list.out.substr(list.out.find('\n') + 1);
  EXPECT_NE(row.find("guest"), std::string::npos);
  EXPECT_EQ(run({"web", "token", "revoke", row.substr(0, 8), "--state", path("state")}).exit_code,
            0);
  EXPECT_EQ(status("GET", "/"), 401) << "at once";
  EXPECT_EQ(run({"web", "token", "revoke", "00000000", "--state", path("state")}).exit_code, 2);
}

TEST_F(Web, AnAddressBeforeTheFirstStartSaysWhatIsMissing) {
  expect_end(run({"web", "address", "--state", path("state")}), 1, "no tokens yet", "token add");
  expect_end(run({"ctl", "--socket", path("c.sock"), "show-address"}), 2, "before the pipe");
}

TEST_F(Web, TheAddressIsThatOfTheServerAndTheCodeOfTheAddress) {
  start_web();
  const ProcessResult plain = run({"web", "address", "--state", path("state")});
  const ProcessResult coded = run({"web", "address", "--state", path("state"), "--code"});
  ASSERT_EQ(plain.exit_code, 0) << plain.err;
  const std::string address = plain.out.substr(0, plain.out.find('\n'));
  EXPECT_TRUE(address.starts_with("http://127.0.0.1:" + std::to_string(port_) + "/")) << address;
  EXPECT_EQ(coded.out, address + "\n" + frames::qr_terminal_text(frames::qr_code_of(address)));
}

TEST_F(Web, FlagsThatOpenTheServerNeedLan) {
  expect_end(
      run({"web", "--socket", path("c.sock"), "--state", path("state"), "--listen", "0.0.0.0:0"}),
      2, "--lan");
  EXPECT_EQ(run({"web", "--state", path("state")}).exit_code, 2) << "no player named";
}

}  // namespace
}  // namespace lenticule::test
