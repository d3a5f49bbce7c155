// SPDX-License-Identifier: Apache-2.0
// Tests the server with clients that are slow, wrong or hostile, and a site that only records.
#include "apps/lenticule-web/http/server.h"

#include <gtest/gtest.h>

#include <atomic>
#include <thread>

#include "tests/support/scratch_folder.h"
#include "tests/unit/web/http_client.h"

namespace lenticule::web {
namespace {

using std::chrono::milliseconds;
using std::chrono::seconds;
using test::HttpAnswer;
using test::HttpClient;

constexpr uint64_t kLargestBody = 1000;

class CountingSink final : public BodySink {
 public:
  explicit CountingSink(std::atomic<int>& ended) : ended_(ended) {}
  ~CountingSink() override {
    std::this_thread::sleep_for(milliseconds(50));
    ++ended_;
  }
  void take(std::span<const uint8_t> bytes) override {
    bytes_ += bytes.size();
    if (bytes_ > 500) throw HttpError(507, "the disk is full");
  }
  Response finish() override { return json_response({{"bytes", bytes_}}); }

 private:
  std::atomic<int>& ended_;
  size_t bytes_ = 0;
};

class RecordingSite final : public Site {
 public:
  Rights needed(const std::string& method, const std::string& path) const override {
    if (path == "/open") return Rights::None;
    return method == "GET" || method == "HEAD" ? Rights::See : Rights::Change;
  }
  uint64_t largest_body(const std::string& method, const std::string&) const override {
    return method == "GET" ? 0 : kLargestBody;
  }
  std::unique_ptr<BodySink> sink(const Request& request) override {
    return request.path == "/sink" ? std::make_unique<CountingSink>(sinks_ended) : nullptr;
  }
  Response answer(const Request& request) override {
    ++answered;
    if (request.path == "/waits") {
      std::this_thread::sleep_for(AnswerTime::at_most(std::chrono::hours(1)));
      throw Error(ErrorKind::Device, "no answer from the player");
    }
    if (request.path == "/fails") throw std::runtime_error("a secret reason");
    if (request.path == "/events" || request.path == "/forever") {
      Response response;
      response.type = "text/event-stream";
      response.events = [sent = 0]() mutable {
        return ++sent > 2 ? std::nullopt : std::optional("event: " + std::to_string(sent) + "\n\n");
      };
      if (request.path == "/forever")
        response.events = [this]() -> std::optional<std::string> {
          std::this_thread::sleep_for(milliseconds(10));
          return stopped ? std::nullopt : std::optional<std::string>("event: more\n\n");
        };
      return response;
    }
    return json_response({{"path", request.path},
                          {"body", request.body},
                          {"peer", request.peer},
                          {"by", request.sender.name}});
  }
  std::atomic<int> answered{0};
  std::atomic<int> sinks_ended{0};
  std::atomic<bool> stopped{false};
};

class WebServer : public testing::Test {
 protected:
  void SetUp() override {
    change_ = add_token(folder_ / "tokens.json", "desk", Rights::Change);
    see_ = add_token(folder_ / "tokens.json", "guest", Rights::See);
    access_ = std::make_unique<Access>(folder_ / "tokens.json");
  }
  void serve(const ServerLimits& limits = {}) {
    std::vector<Listener> listeners;
    listeners.push_back(listen_tcp({.host = "127.0.0.1", .port = 0}, false));
    port_ = parse_listen_address(listeners.front().name).port;
    server_ = std::make_unique<Server>(std::move(listeners), site_, *access_, limits);
  }
  HttpAnswer ask(const std::string& method, const std::string& path,
                 const std::map<std::string, std::string>& headers = {},
                 const std::string& body = {}) const {
    return HttpClient(port_).ask(method, path, headers, body);
  }
  [[nodiscard]] std::map<std::string, std::string> bearer(const Token& token) const {
    return {{"Authorization", "Bearer " + token.secret}};
  }
  [[nodiscard]] std::map<std::string, std::string> cookie(const Token& token) const {
    return {{"Cookie", "x=1; lenticule=" + access_->cookie_of(token.secret)}};
  }

  test::ScratchFolder folder_;
  Token change_, see_;
  std::unique_ptr<Access> access_;
  RecordingSite site_;
  uint16_t port_ = 0;
  std::unique_ptr<Server> server_;
};

TEST_F(WebServer, RightsAreSeeAndChange) {
  serve();
  EXPECT_EQ(ask("GET", "/open").status, 200);
  EXPECT_EQ(ask("GET", "/x").status, 401);
  EXPECT_EQ(ask("POST", "/x").status, 401);
  EXPECT_EQ(ask("GET", "/x", bearer(see_)).status, 200);
  EXPECT_EQ(ask("POST", "/x", bearer(see_)).status, 403);
  EXPECT_EQ(ask("POST", "/x", bearer(change_)).status, 200);
  EXPECT_EQ(ask("POST", "/x", cookie(change_)).status, 200);
  EXPECT_EQ(ask("GET", "/x", {{"Authorization", "Bearer 0123"}}).status, 401);
  EXPECT_EQ(site_.answered, 4) << "a refused request does not reach the site";
}

TEST_F(WebServer, ATokenInTheAddressBecomesACookieOfThisSiteOnly) {
  serve();
  const HttpAnswer entered = ask("GET", "/enter?token=" + change_.secret);
  ASSERT_EQ(entered.status, 200);
  const std::string set = entered.header("Set-Cookie");
  EXPECT_NE(set.find("HttpOnly"), std::string::npos);
  EXPECT_NE(set.find("SameSite=Strict"), std::string::npos);
  EXPECT_EQ(entered.body.find(change_.secret), std::string::npos);
  const std::string value = set.substr(0, set.find(';'));
  EXPECT_EQ(ask("GET", "/x", {{"Cookie", value}}).status, 200);
  EXPECT_EQ(ask("GET", "/enter?token=" + std::string(32, '0')).status, 401);
  EXPECT_EQ(ask("GET", "/enter").status, 401);
}

TEST_F(WebServer, GuessingTokensIsSlowedDownPerAddress) {
  serve({.wrong_tokens_burst = 3, .wrong_tokens_per_s = 0.0001});
  for (int k = 0; k < 3; ++k)
    EXPECT_EQ(ask("GET", "/x", {{"Authorization", "Bearer no"}}).status, 401);
  EXPECT_EQ(ask("GET", "/x", {{"Authorization", "Bearer no"}}).status, 429);
  EXPECT_EQ(ask("GET", "/enter?token=no").status, 429);
  EXPECT_EQ(ask("GET", "/x", bearer(change_)).status, 200) << "a neighbour guessed";
  EXPECT_EQ(ask("GET", "/enter?token=" + change_.secret).status, 200);
  EXPECT_EQ(ask("GET", "/x", cookie(change_)).status, 200);
  EXPECT_EQ(HttpClient(port_, "127.0.0.2").ask("GET", "/x").status, 401);
}

TEST_F(WebServer, TooManyRequestsAreRefused) {
  serve({.requests_burst = 5, .requests_per_s = 0.0001});
  for (int k = 0; k < 5; ++k) EXPECT_EQ(ask("GET", "/open").status, 200);
  const HttpAnswer refused = ask("GET", "/open");
  EXPECT_EQ(refused.status, 429);
  EXPECT_FALSE(refused.header("Retry-After").empty());
  EXPECT_EQ(ask("GET", "/x", bearer(see_)).status, 200) << "a neighbour asked too often";
}

TEST_F(WebServer, PagesOfOtherSitesCannotChangeAnything) {
  serve();
  auto headers = cookie(change_);
  headers["Origin"] = "http://evil.example";
  EXPECT_EQ(ask("POST", "/x", headers).status, 403);
  headers["Origin"] = "null";
  EXPECT_EQ(ask("POST", "/x", headers).status, 403);
  headers["Origin"] = "http://panel:8420";
  EXPECT_EQ(ask("POST", "/x", headers).status, 200);
  headers["Sec-Fetch-Site"] = "same-site";
  EXPECT_EQ(ask("POST", "/x", headers).status, 403);
  const HttpAnswer answer = ask("OPTIONS", "/x", headers);
  EXPECT_EQ(answer.head.find("Access-Control"), std::string::npos);
}

TEST_F(WebServer, EveryAnswerConfinesItsPage) {
  serve();
  for (const HttpAnswer& answer :
       {ask("GET", "/open"), ask("GET", "/x"), ask("GET", "/enter"),
        ask("GET", "/x", {{"Accept", "text/html"}}), ask("POST", "/x", bearer(see_))}) {
    const std::string policy = answer.header("Content-Security-Policy");
    EXPECT_NE(policy.find("default-src 'none'"), std::string::npos);
    EXPECT_EQ(policy.find("unsafe"), std::string::npos);
    EXPECT_EQ(policy.find("http"), std::string::npos) << "no outside address";
    EXPECT_EQ(answer.header("X-Content-Type-Options"), "nosniff");
    EXPECT_EQ(answer.header("Cache-Control"), "no-store");
    EXPECT_EQ(answer.head.find("Access-Control"), std::string::npos);
  }
  EXPECT_EQ(ask("GET", "/x", {{"Accept", "text/html"}}).header("Content-Type"),
            "text/html; charset=utf-8");
}

TEST_F(WebServer, RequestsAboveTheirSizeAreRefused) {
  serve();
  const auto headers = bearer(change_);
  EXPECT_EQ(ask("POST", "/x", headers, std::string(kLargestBody, 'a')).status, 200);
  EXPECT_EQ(ask("POST", "/x", headers, std::string(kLargestBody + 1, 'a')).status, 413);
  EXPECT_EQ(ask("GET", "/x", headers, "a").status, 413);
  auto wrong = headers;
  wrong["Content-Length"] = "99999999999999999999999";
  EXPECT_GE(ask("POST", "/x", wrong).status, 400);
  // In chunks, without a length.
  HttpClient chunked(port_);
  chunked.say(
      "POST /x HTTP/1.1\r\nHost: a\r\nTransfer-Encoding: chunked\r\nAuthorization: Bearer " +
      change_.secret + "\r\n\r\n");
  for (int k = 0; k < 20; ++k) chunked.say("64\r\n" + std::string(100, 'a') + "\r\n");
  chunked.say("0\r\n\r\n");
  EXPECT_EQ(chunked.answer().status, 413);
  EXPECT_GE(ask("GET", "/" + std::string(100'000, 'a')).status, 400);
  EXPECT_GE(ask("GET", "/open", {{"X", std::string(100'000, 'a')}}).status, 400);
  EXPECT_EQ(ask("GET", "/open").status, 200);
}

TEST_F(WebServer, ASinkMayRefuseTheRestOfABodyAndEndsBeforeTheAnswerArrives) {
  serve();
  EXPECT_EQ(ask("PUT", "/sink", bearer(change_), std::string(400, 'a')).body, "{\"bytes\":400}\n");
  EXPECT_EQ(site_.sinks_ended, 1);
  EXPECT_EQ(ask("PUT", "/sink", bearer(change_), std::string(900, 'a')).status, 507);
  EXPECT_EQ(site_.sinks_ended, 2);
}

TEST_F(WebServer, AFailureTellsStrangersNothing) {
  serve();
  const HttpAnswer failed = ask("GET", "/fails", bearer(see_));
  EXPECT_EQ(failed.status, 500);
  EXPECT_EQ(failed.body.find("secret reason"), std::string::npos);
}

TEST_F(WebServer, AnAnswerThatWouldTakeTooLongIsAStatusInTime) {
  serve({.answer_time = seconds(2)});
  EXPECT_EQ(ask("GET", "/waits", bearer(see_)).status, 502);
  EXPECT_EQ(AnswerTime::at_most(std::chrono::hours(1)), std::chrono::hours(1))
      << "other threads have no limit";
}

TEST_F(WebServer, AStreamContinuesUntilItsEnd) {
  serve();
  HttpClient client(port_);
  client.say("GET /events HTTP/1.1\r\nHost: a\r\nAuthorization: Bearer " + see_.secret +
             "\r\n\r\n");
  const std::string all = client.hear_until("0\r\n\r\n");
  EXPECT_NE(all.find("event: 1"), std::string::npos);
  EXPECT_NE(all.find("event: 2"), std::string::npos);
}

TEST_F(WebServer, TwoHundredSlowClientsDelayOnlyThemselves) {
  serve();
  std::vector<std::unique_ptr<HttpClient>> slow;
  for (int k = 0; k < 200; ++k) {
    slow.push_back(std::make_unique<HttpClient>(port_, "127.0.1." + std::to_string(1 + k / 10)));
    ASSERT_TRUE(slow.back()->connected());
    ASSERT_TRUE(slow.back()->say(k % 2 == 0 ? "GET /op" : "POST /x HTTP/1.1\r\nHost: a\r\nConte"));
  }
  for (int k = 0; k < 20; ++k) {
    for (const auto& client : slow) (void)client->say("n");
    EXPECT_EQ(ask("GET", "/x", bearer(see_)).status, 200) << k;
  }
}

TEST_F(WebServer, AClientThatSendsByteByByteIsEnded) {
  serve({.head_time = milliseconds(700)});
  const HttpClient slow(port_);
  std::string head = "GET /open HTTP/1.1\r\nX-Slow: ";
  bool ended = false;
  for (int k = 0; k < 600 && !ended; ++k) {
    ended = !slow.say(head.empty() ? "a" : std::exchange(head, {}));
    std::this_thread::sleep_for(milliseconds(20));
  }
  EXPECT_TRUE(ended);
  EXPECT_EQ(ask("GET", "/open").status, 200);
}

TEST_F(WebServer, ABodyThatArrivesTooSlowlyIsEnded) {
  serve({.head_time = milliseconds(700), .slowest_bytes_per_s = 1'000'000});
  const HttpClient slow(port_);
  slow.say("POST /x HTTP/1.1\r\nHost: a\r\nContent-Length: 900\r\nAuthorization: Bearer " +
           change_.secret + "\r\n\r\n");
  bool ended = false;
  for (int k = 0; k < 600 && !ended; ++k) {
    ended = !slow.say("a");
    std::this_thread::sleep_for(milliseconds(20));
  }
  EXPECT_TRUE(ended);
  EXPECT_EQ(site_.answered, 0);
}

TEST_F(WebServer, OneAddressCannotTakeAllConnections) {
  serve({.connections = 40, .connections_per_address = 10});
  std::vector<std::unique_ptr<HttpClient>> many;
  for (int k = 0; k < 60; ++k) many.push_back(std::make_unique<HttpClient>(port_, "127.0.0.7"));
  EXPECT_EQ(ask("GET", "/open").status, 200);
  // A connection above the limit makes room for the next one once its socket is closed.
  for (int k = 0; k < 500 && server_->connections() > 12; ++k)
    std::this_thread::sleep_for(std::chrono::milliseconds(10));
  EXPECT_LE(server_->connections(), 12u);
}

TEST_F(WebServer, HalfOpenConnectionsOfAnAddressMakeRoomForItsOwner) {
  serve({.connections = 40, .connections_per_address = 10});
  std::vector<std::unique_ptr<HttpClient>> many;
  for (int k = 0; k < 15; ++k) {
    many.push_back(std::make_unique<HttpClient>(port_));
    many.back()->say("GET /x HTTP/1.1\r\n");
  }
  for (int k = 0; k < 15; ++k) EXPECT_EQ(ask("GET", "/x", cookie(change_)).status, 200);
}

TEST_F(WebServer, ARevokedTokenEndsItsStreamsAndRequests) {
  serve();
  HttpClient stream(port_), stays(port_), idle(port_);
  for (HttpClient* client : {&stream, &stays})
    client->say("GET /forever HTTP/1.1\r\nHost: a\r\nAuthorization: Bearer " +
                (client == &stream ? see_ : change_).secret + "\r\n\r\n");
  EXPECT_NE(stream.hear_until("event: more").find(" 200 "), std::string::npos);
  EXPECT_NE(stays.hear_until("event: more").find(" 200 "), std::string::npos);
  EXPECT_EQ(idle.ask("GET", "/x", bearer(see_)).status, 200);
  revoke_token(folder_ / "tokens.json", see_.id);
  EXPECT_EQ(idle.ask("GET", "/x", bearer(see_)).status, 401);
  EXPECT_EQ(stream.hear_until("no such text").find("no such text"), std::string::npos) << "ended";
  EXPECT_NE(stays.hear_until("event: more").find("event: more"), std::string::npos);
  site_.stopped = true;
}

TEST_F(WebServer, StrangersFromManyAddressesMakeRoomForKnownOnes) {
  serve({.connections = 40, .connections_per_address = 10});
  HttpClient known(port_, "127.0.0.1");
  EXPECT_EQ(known.ask("GET", "/x", bearer(see_)).status, 200);
  std::vector<std::unique_ptr<HttpClient>> many;
  for (int k = 0; k < 120; ++k)
    many.push_back(std::make_unique<HttpClient>(port_, "127.0.2." + std::to_string(1 + k / 8)));
  EXPECT_EQ(known.ask("GET", "/x", bearer(see_)).status, 200) << "is not ended for strangers";
  // Connections that are being ended count until their threads have ended.
  int status = 0;
  for (int k = 0; k < 200 && status != 200; ++k) {
    status = HttpClient(port_, "127.0.3.1").ask("GET", "/x", bearer(see_)).status;
    if (status != 200) std::this_thread::sleep_for(milliseconds(10));
  }
  EXPECT_EQ(status, 200);
}

TEST_F(WebServer, AnEncodedZeroDoesNotShortenAnAddress) {
  serve();
  EXPECT_EQ(ask("GET", "/a%00b", bearer(see_)).body.find("\"path\":\"/a\""), std::string::npos);
  EXPECT_NE(ask("GET", "/a%20b", bearer(see_)).body.find("\"path\":\"/a b\""), std::string::npos);
}

TEST_F(WebServer, ARequestWithTwoLengthsIsRefusedAndItsRestIsNoRequest) {
  serve();
  for (const char* lengths :
       {"Content-Length: 2\r\nContent-Length: 2", "Content-Length: 2\r\nContent-Length: 7",
        "Content-Length: 2\r\nTransfer-Encoding: chunked",
        "transfer-encoding: chunked\r\ncontent-length: 40"}) {
    HttpClient client(port_);
    client.say(std::string("POST /open HTTP/1.1\r\nHost: a\r\n") + lengths +
               "\r\n\r\n0\r\n\r\nGET /open HTTP/1.1\r\nHost: a\r\n\r\n");
    EXPECT_EQ(client.answer().status, 400) << lengths;
    EXPECT_EQ(client.answer().status, 0) << lengths;
  }
  EXPECT_EQ(site_.answered, 0);
}

TEST_F(WebServer, GarbageIsRefused) {
  serve();
  for (const std::string& garbage :
       {std::string("\r\n\r\n\r\n"), std::string("GET\r\n\r\n"), std::string(3000, '\0'),
        std::string("GET / HTTP/9.9\r\n\r\n"), std::string("\x16\x03\x01\x02\x00\x01\x00", 7),
        std::string(
            "GET /x HTTP/1.1\r\nHost: a\r\nContent-Length: 5\r\nContent-Length: 7\r\n\r\nab"),
        std::string("GET /%00/../../etc/passwd HTTP/1.1\r\nHost: a\r\n\r\n")}) {
    HttpClient client(port_, "127.0.0.1", seconds(1));
    client.say(garbage);
    EXPECT_NE(client.answer().status, 200);
  }
  EXPECT_EQ(ask("GET", "/open").status, 200);
}

}  // namespace
}  // namespace lenticule::web
