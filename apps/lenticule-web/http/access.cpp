// SPDX-License-Identifier: Apache-2.0
#include "apps/lenticule-web/http/access.h"

#include <fcntl.h>
#include <fmt/chrono.h>
#include <fmt/format.h>
#include <openssl/crypto.h>
#include <openssl/evp.h>
#include <openssl/hmac.h>
#include <sys/file.h>
#include <sys/random.h>
#include <sys/stat.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstring>
#include <ctime>
#include <nlohmann/json.hpp>
#include <span>

#include "base/error.h"
#include "base/file.h"
#include "base/print.h"
#include "base/text.h"

namespace lenticule::web {
namespace {

using nlohmann::json;

constexpr size_t kMaxTokens = 100;
constexpr uint64_t kMaxFileBytes = 64u << 10;
constexpr size_t kSecretDigits = 32;
constexpr size_t kIdDigits = 8;

std::string hexadecimal(std::span<const uint8_t> bytes) {
  std::string text;
  for (const uint8_t byte : bytes) text += fmt::format("{:02x}", byte);
  return text;
}

bool is_hexadecimal(std::string_view text, size_t digits) {
  return text.size() == digits && text.find_first_not_of("0123456789abcdef") == text.npos;
}

template <size_t kBytes>
std::string random_digits() {
  std::array<uint8_t, kBytes> bytes{};
  if (getrandom(bytes.data(), bytes.size(), 0) != static_cast<ssize_t>(bytes.size()))
    throw Error(ErrorKind::Failed, "token: the kernel has no random numbers");
  return hexadecimal(bytes);
}

[[noreturn]] void refuse(const std::filesystem::path& file, const std::string& cause) {
  throw Error(ErrorKind::Input, file.string() + ": " + cause,
              "remove the file; new tokens: lenticule web token add NAME");
}

Token token_of(const json& entry, const std::filesystem::path& file) {
  if (!entry.is_object()) refuse(file, "not a list of tokens");
  const auto text = [&](const char* key) {
    const auto found = entry.find(key);
    if (found == entry.end() || !found->is_string())
      refuse(file, fmt::format("a token has no {}", key));
    return found->get<std::string>();
  };
  Token token{.id = text("id"),
              .name = text("name"),
              .rights = rights_named(text("rights")).value_or(Rights::None),
              .secret = text("token"),
              .made = text("made")};
  if (!is_hexadecimal(token.id, kIdDigits) || !is_hexadecimal(token.secret, kSecretDigits) ||
      token.rights == Rights::None)
    refuse(file, "a token is not valid");
  return token;
}

void write_tokens(const std::filesystem::path& file, const std::vector<Token>& tokens) {
  json root = {{"format", 1}, {"tokens", json::array()}};
  for (const Token& token : tokens)
    root["tokens"].push_back({{"id", token.id},
                              {"name", token.name},
                              {"rights", rights_name(token.rights)},
                              {"token", token.secret},
                              {"made", token.made}});
  // The secrets must not be readable by others at any time.
  const mode_t mask = ::umask(0077);
  try {
    write_text_file(file, json_text(root, 2) + "\n");
  } catch (...) {
    ::umask(mask);
    throw;
  }
  ::umask(mask);
}

/// Locks the file's folder while its tokens are changed.
UniqueFd lock_folder_of(const std::filesystem::path& file) {
  UniqueFd fd(::open(file.parent_path().c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC));
  if (!fd || ::flock(fd.get(), LOCK_EX) != 0)
    throw Error(ErrorKind::Failed, fmt::format("{}: cannot be locked: {}",
                                               file.parent_path().string(), std::strerror(errno)));
  return fd;
}

std::string cookie_digits(const Token& token) {
  constexpr std::string_view kUse = "lenticule-web cookie 1";
  std::array<uint8_t, 32> digest{};
  unsigned length = 0;
  const auto* const made =
      HMAC(EVP_sha256(), token.secret.data(), static_cast<int>(token.secret.size()),
           reinterpret_cast<const uint8_t*>(kUse.data()), kUse.size(), digest.data(), &length);
  LENTICULE_CHECK(made != nullptr && length == digest.size());
  return token.id + "." + hexadecimal(digest);
}

Identity identity_of(const Token& token) {
  return {.rights = token.rights, .token_id = token.id, .name = token.name};
}

}  // namespace

const char* rights_name(Rights rights) {
  switch (rights) {
    case Rights::None:
      return "none";
    case Rights::See:
      return "see";
    case Rights::Change:
      return "change";
  }
  return "none";
}

std::optional<Rights> rights_named(std::string_view name) {
  if (name == "see") return Rights::See;
  if (name == "change") return Rights::Change;
  return std::nullopt;
}

std::vector<Token> read_tokens(const std::filesystem::path& file) {
  std::error_code error;
  if (!std::filesystem::exists(file, error)) return {};
  const json root = json::parse(read_text_file(file, kMaxFileBytes), nullptr, false);
  if (!root.is_object() || !root.contains("tokens") || !root["tokens"].is_array())
    refuse(file, "not a list of tokens");
  std::vector<Token> tokens;
  for (const json& entry : root["tokens"]) tokens.push_back(token_of(entry, file));
  if (tokens.size() > kMaxTokens) refuse(file, fmt::format("more than {} tokens", kMaxTokens));
  return tokens;
}

Token add_token(const std::filesystem::path& file, const std::string& name, Rights rights) {
  const UniqueFd lock = lock_folder_of(file);
  std::vector<Token> tokens = read_tokens(file);
  if (tokens.size() >= kMaxTokens)
    throw Error(ErrorKind::Usage, fmt::format("token: there are {} already", kMaxTokens),
                "revoke one: lenticule web token revoke ID");
  tokens.push_back({.id = random_digits<kIdDigits / 2>(),
                    .name = shortened(escaped(name), 60),
                    .rights = rights,
                    .secret = random_digits<kSecretDigits / 2>(),
                    .made = fmt::format("{:%FT%TZ}", fmt::gmtime(std::time(nullptr)))});
  write_tokens(file, tokens);
  return tokens.back();
}

void revoke_token(const std::filesystem::path& file, const std::string& id) {
  const UniqueFd lock = lock_folder_of(file);
  std::vector<Token> tokens = read_tokens(file);
  if (std::erase_if(tokens, [&](const Token& token) { return token.id == id; }) == 0)
    throw Error(ErrorKind::Usage, fmt::format("token: no token has the id '{}'", id),
                "lenticule web token list shows the ids");
  write_tokens(file, tokens);
}

bool equal_secrets(std::string_view one, std::string_view other) {
  return one.size() == other.size() && CRYPTO_memcmp(one.data(), other.data(), one.size()) == 0;
}

Access::Access(std::filesystem::path tokens)
    : file_(std::move(tokens)), tokens_(read_tokens(file_)), mark_(mark_of(file_)) {}

void Access::refresh() {
  const FileMark mark = mark_of(file_);
  if (mark_ && mark == *mark_) return;
  try {
    tokens_ = read_tokens(file_);
    mark_ = mark;
  } catch (const Error& error) {
    if (mark_) say("{}\n", error.what());
    tokens_.clear();
    mark_.reset();
  }
}

// Every token is compared, so that the time does not depend on which one matches.
Identity Access::with_token(std::string_view secret) {
  const std::lock_guard lock(mutex_);
  refresh();
  Identity found;
  for (const Token& token : tokens_)
    if (equal_secrets(token.secret, secret)) found = identity_of(token);
  return found;
}

Identity Access::with_cookie(std::string_view value) {
  const std::lock_guard lock(mutex_);
  refresh();
  Identity found;
  for (const Token& token : tokens_)
    if (equal_secrets(cookie_digits(token), value)) found = identity_of(token);
  return found;
}

bool Access::is_valid(std::string_view token_id) {
  const std::lock_guard lock(mutex_);
  refresh();
  return std::any_of(tokens_.begin(), tokens_.end(),
                     [&](const Token& token) { return token.id == token_id; });
}

std::string Access::cookie_of(std::string_view secret) {
  const std::lock_guard lock(mutex_);
  std::string cookie;
  for (const Token& token : tokens_)
    if (equal_secrets(token.secret, secret)) cookie = cookie_digits(token);
  return cookie;
}

}  // namespace lenticule::web
