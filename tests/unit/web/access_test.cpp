// SPDX-License-Identifier: Apache-2.0
#include "apps/lenticule-web/http/access.h"

#include <gtest/gtest.h>
#include <sys/stat.h>

#include <fstream>

#include "apps/lenticule-web/http/server.h"
#include "base/error.h"
#include "tests/support/scratch_folder.h"

namespace lenticule::web {
namespace {

using std::chrono::seconds;

TEST(WebAccess, ATokenHas128BitsAndIsUnreadableForOthers) {
  const test::ScratchFolder folder;
  const Token one = add_token(folder / "tokens.json", "lobby", Rights::Change);
  const Token other = add_token(folder / "tokens.json", "lobby", Rights::See);
  EXPECT_EQ(one.secret.size(), 32u);
  EXPECT_NE(one.secret, other.secret);
  struct stat status {};
  ASSERT_EQ(::stat((folder / "tokens.json").c_str(), &status), 0);
  EXPECT_EQ(status.st_mode & 0777, 0600u);
  EXPECT_EQ(read_tokens(folder / "tokens.json").size(), 2u);
}

TEST(WebAccess, TheCookieIsNotTheTokenAndSurvivesARestart) {
  const test::ScratchFolder folder;
  const Token token = add_token(folder / "tokens.json", "lobby", Rights::See);
  std::string cookie;
  {
    Access access(folder / "tokens.json");
    EXPECT_EQ(access.with_token(token.secret).rights, Rights::See);
    cookie = access.cookie_of(token.secret);
    EXPECT_EQ(cookie.find(token.secret), std::string::npos);
    EXPECT_EQ(access.with_token(cookie).rights, Rights::None);
    EXPECT_EQ(access.with_cookie(token.secret).rights, Rights::None);
  }
  Access access(folder / "tokens.json");
  EXPECT_EQ(access.with_cookie(cookie).token_id, token.id);
  for (size_t k = 0; k < cookie.size(); ++k) {
    std::string wrong = cookie;
    wrong[k] = wrong[k] == '0' ? '1' : '0';
    EXPECT_EQ(access.with_cookie(wrong).rights, Rights::None) << k;
  }
  EXPECT_EQ(access.with_cookie("").rights, Rights::None);
  EXPECT_EQ(access.with_token("").rights, Rights::None);
}

TEST(WebAccess, ARevokedTokenEndsWithItsCookies) {
  const test::ScratchFolder folder;
  const Token token = add_token(folder / "tokens.json", "lobby", Rights::Change);
  const Token stays = add_token(folder / "tokens.json", "desk", Rights::See);
  Access access(folder / "tokens.json");
  const std::string cookie = access.cookie_of(token.secret);
  revoke_token(folder / "tokens.json", token.id);
  EXPECT_THROW(revoke_token(folder / "tokens.json", token.id), Error);
  EXPECT_EQ(access.with_token(token.secret).rights, Rights::None);
  EXPECT_FALSE(access.is_valid(token.id));
  EXPECT_EQ(access.with_cookie(cookie).rights, Rights::None);
  EXPECT_EQ(access.with_token(stays.secret).rights, Rights::See);
}

TEST(WebAccess, ANewTokenIsValidAtOnce) {
  const test::ScratchFolder folder;
  Access access(folder / "tokens.json");
  EXPECT_EQ(access.with_token("0123").rights, Rights::None);
  const Token token = add_token(folder / "tokens.json", "desk", Rights::See);
  EXPECT_EQ(access.with_token(token.secret).rights, Rights::See);
}

TEST(WebAccess, ADamagedFileOfTokensIsRefused) {
  const test::ScratchFolder folder;
  for (const char* text :
       {"", "[]", "{\"tokens\": [1]}", "{\"tokens\": [{\"id\": \"x\"}]}",
        "{\"tokens\": [{\"id\": \"0123abcd\", \"name\": \"\", \"rights\": \"all\","
        " \"token\": \"00112233445566778899aabbccddeeff\", \"made\": \"\"}]}"}) {
    std::ofstream(folder / "tokens.json") << text;
    EXPECT_THROW((void)read_tokens(folder / "tokens.json"), Error) << text;
  }
}

TEST(WebAccess, SecretsAreComparedAsAWhole) {
  EXPECT_TRUE(equal_secrets("abc", "abc"));
  EXPECT_FALSE(equal_secrets("abc", "abd"));
  EXPECT_FALSE(equal_secrets("abc", "ab"));
  EXPECT_TRUE(equal_secrets("", ""));
}

TEST(WebRateLimit, RemembersABoundedNumberOfAddresses) {
  RateLimit limit(3, 0.001);
  const auto start = RateLimit::Clock::now();
  for (size_t k = 0; k < 3 * RateLimit::kMaxAddresses; ++k)
    EXPECT_TRUE(limit.permits(std::to_string(k), start));
  EXPECT_LE(limit.addresses(), RateLimit::kMaxAddresses);
}

TEST(WebListener, OtherMachinesNeedLan) {
  EXPECT_NO_THROW((void)listen_tcp({.host = "127.0.0.1", .port = 0}, false));
  EXPECT_THROW((void)listen_tcp({.host = "0.0.0.0", .port = 0}, false), Error);
  EXPECT_NO_THROW((void)listen_tcp({.host = "0.0.0.0", .port = 0}, true));
}

TEST(WebListener, ParsesNumericAddressesWithAPort) {
  EXPECT_EQ(parse_listen_address("127.0.0.1:8420").port, 8420);
  EXPECT_EQ(parse_listen_address("[::1]:80").host, "::1");
  for (const char* wrong : {"", "8420", "127.0.0.1", "localhost:80", "::1:80", "127.0.0.1:70000",
                            "127.0.0.1:", ":80", "[::1]", "1.2.3:80"})
    EXPECT_THROW((void)parse_listen_address(wrong), Error) << wrong;
}

TEST(WebListener, AUnixSocketReplacesADeadServerOnly) {
  const test::ScratchFolder folder;
  const std::filesystem::path path = folder / "web.sock";
  { const Listener dead = listen_unix(path); }
  const Listener live = listen_unix(path);
  EXPECT_TRUE(live.is_unix);
  EXPECT_THROW((void)listen_unix(path), Error);
  std::ofstream(folder / "file") << "content";
  EXPECT_THROW((void)listen_unix(folder / "file"), Error);
}

}  // namespace
}  // namespace lenticule::web
