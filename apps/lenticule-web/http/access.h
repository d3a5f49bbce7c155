// SPDX-License-Identifier: Apache-2.0
// Access decides what the sender of a request may do. A token of 128 bits, in the address that a
// user opens, is exchanged for a cookie; programs send the token itself. Tokens are in a file of
// mode 0600 in the state folder.
#pragma once

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
#include <filesystem>
#include <mutex>
#include <nlohmann/json.hpp>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "base/error_kinds.h"
#include "base/file.h"
#include "base/print.h"
#include "base/text.h"

namespace lenticule::web {

enum class Rights { None, See, Change };

[[nodiscard]] inline const char* rights_name(Rights rights) {
  return rights == Rights::Change ? "change" : rights == Rights::See ? "see" : "none";
}
[[nodiscard]] inline std::optional<Rights> rights_named(std::string_view name) {
  if (name == "see") return Rights::See;
  if (name == "change") return Rights::Change;
  return std::nullopt;
}

struct Token {
  std::string id;    ///< eight hexadecimal digits, not secret
  std::string name;  ///< for people: who has the token
  Rights rights = Rights::None;
  std::string secret;  ///< 32 hexadecimal digits
  std::string made;    ///< date and time, UTC
};

/// Identity is the sender of a request, as its token states it.
struct Identity {
  Rights rights = Rights::None;
  std::string token_id{};
  std::string name{};
};

inline std::string hexadecimal(std::span<const uint8_t> bytes) {
  std::string text;
  for (const uint8_t byte : bytes) text += fmt::format("{:02x}", byte);
  return text;
}

template <size_t kBytes>
std::string random_digits() {
  std::array<uint8_t, kBytes> bytes{};
  if (getrandom(bytes.data(), bytes.size(), 0) != static_cast<ssize_t>(bytes.size()))
    throw Error(ErrorKind::Failed, "token: the kernel has no random numbers");
  return hexadecimal(bytes);
}

inline void write_tokens(const std::filesystem::path& file, const std::vector<Token>& tokens) {
  nlohmann::json root = {{"format", 1}, {"tokens", nlohmann::json::array()}};
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
inline UniqueFd lock_folder_of(const std::filesystem::path& file) {
  UniqueFd fd(::open(file.parent_path().c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC));
  if (!fd || ::flock(fd.get(), LOCK_EX) != 0)
    throw failed_error("{}: cannot be locked: {}", file.parent_path().string(),
                       std::strerror(errno));
  return fd;
}

inline constexpr size_t kMaxTokens = 100;
inline constexpr uint64_t kMaxTokenFileBytes = 64u << 10;
inline constexpr size_t kSecretDigits = 32;
inline constexpr size_t kIdDigits = 8;

inline bool is_hexadecimal(std::string_view text, size_t digits) {
  return text.size() == digits && text.find_first_not_of("0123456789abcdef") == text.npos;
}

[[noreturn]] inline void refuse(const std::filesystem::path& file, const std::string& cause) {
  throw input_error("{}: {}", file.string(), cause)
      .remedy("remove the file; new tokens: lenticule web token add NAME");
}

inline Token token_of(const nlohmann::json& entry, const std::filesystem::path& file) {
  const auto text = [&](const char* key) { return entry.at(key).get<std::string>(); };
  try {
    Token token{.id = text("id"),
                .name = text("name"),
                .rights = rights_named(text("rights")).value_or(Rights::None),
                .secret = text("token"),
                .made = text("made")};
    if (is_hexadecimal(token.id, kIdDigits) && is_hexadecimal(token.secret, kSecretDigits) &&
        token.rights != Rights::None)
      return token;
  } catch (const nlohmann::json::exception&) {  // no such key, or no text
  }
  refuse(file, "a token is not valid");
}

/// Reads the tokens; none if the file does not exist. Throws Error(Input) for a file that is not
/// valid.
[[nodiscard]] inline std::vector<Token> read_tokens(const std::filesystem::path& file) {
  std::error_code error;
  if (!std::filesystem::exists(file, error)) return {};
  const nlohmann::json root =
      nlohmann::json::parse(read_text_file(file, kMaxTokenFileBytes), nullptr, false);
  if (!root.is_object() || !root.contains("tokens") || !root["tokens"].is_array())
    refuse(file, "not a list of tokens");
  std::vector<Token> tokens;
  for (const nlohmann::json& entry : root["tokens"]) tokens.push_back(token_of(entry, file));
  if (tokens.size() > kMaxTokens) refuse(file, fmt::format("more than {} tokens", kMaxTokens));
  return tokens;
}
/// Adds a token with a new random secret, and returns it. Throws Error(Failed).
inline Token add_token(const std::filesystem::path& file, const std::string& name, Rights rights) {
  const UniqueFd lock = lock_folder_of(file);
  std::vector<Token> tokens = read_tokens(file);
  if (tokens.size() >= kMaxTokens)
    throw usage_error("token: there are {} already", kMaxTokens)
        .remedy("revoke one: lenticule web token revoke ID");
  tokens.push_back({.id = random_digits<kIdDigits / 2>(),
                    .name = shortened(escaped(name), 60),
                    .rights = rights,
                    .secret = random_digits<kSecretDigits / 2>(),
                    .made = fmt::format("{:%FT%TZ}", fmt::gmtime(std::time(nullptr)))});
  write_tokens(file, tokens);
  return tokens.back();
}
/// Removes the token with that id. Throws Error(Usage) if there is none.
inline void revoke_token(const std::filesystem::path& file, const std::string& id) {
  const UniqueFd lock = lock_folder_of(file);
  std::vector<Token> tokens = read_tokens(file);
  if (std::erase_if(tokens, [&](const Token& token) { return token.id == id; }) == 0)
    throw usage_error("token: no token has the id '{}'", id)
        .remedy("lenticule web token list shows the ids");
  write_tokens(file, tokens);
}

/// Compares in a time that depends on the lengths only.
[[nodiscard]] inline bool equal_secrets(std::string_view one, std::string_view other) {
  return one.size() == other.size() && CRYPTO_memcmp(one.data(), other.data(), one.size()) == 0;
}

/// Thread safety: any thread.
class Access {
 public:
  /// Throws as read_tokens() does. Tokens that are added or revoked later take effect at once. If
  /// the file cannot be read then, no token is valid.
  explicit Access(std::filesystem::path tokens)
      : file_(std::move(tokens)), tokens_(read_tokens(file_)), mark_(mark_of(file_)) {}

  /// Returns the identity of a token; rights None if it is not valid.
  [[nodiscard]] Identity with_token(std::string_view secret) {
    return identity_with(secret, [](const Token& token) { return token.secret; });
  }
  /// Returns the identity of a cookie; rights None if it is not valid.
  [[nodiscard]] Identity with_cookie(std::string_view value) {
    return identity_with(value, cookie_digits);
  }
  /// Returns true if the token with that id was not revoked.
  [[nodiscard]] bool is_valid(std::string_view token_id) {
    const std::lock_guard lock(mutex_);
    refresh();
    return std::ranges::find(tokens_, token_id, &Token::id) != tokens_.end();
  }
  /// Returns the cookie of a valid token. The cookie does not contain the token, and is valid as
  /// long as the token, also after a restart of the server.
  [[nodiscard]] std::string cookie_of(std::string_view secret) {
    const std::lock_guard lock(mutex_);
    std::string cookie;
    for (const Token& token : tokens_)
      if (equal_secrets(token.secret, secret)) cookie = cookie_digits(token);
    return cookie;
  }

 private:
  static std::string cookie_digits(const Token& token) {
    constexpr std::string_view kUse = "lenticule-web cookie 1";
    std::array<uint8_t, 32> digest{};
    unsigned length = 0;
    const auto* const made =
        HMAC(EVP_sha256(), token.secret.data(), static_cast<int>(token.secret.size()),
             reinterpret_cast<const uint8_t*>(kUse.data()), kUse.size(), digest.data(), &length);
    LENTICULE_CHECK(made != nullptr && length == digest.size());
    return token.id + "." + hexadecimal(digest);
  }

  /// Returns the identity of the token of which `part` is `value`. Every token is compared, so that
  /// the time does not depend on which one matches.
  [[nodiscard]] Identity identity_with(std::string_view value, const auto& part) {
    const std::lock_guard lock(mutex_);
    refresh();
    Identity found;
    for (const Token& token : tokens_)
      if (equal_secrets(part(token), value))
        found = {.rights = token.rights, .token_id = token.id, .name = token.name};
    return found;
  }
  void refresh() {
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

  const std::filesystem::path file_;
  std::mutex mutex_;  ///< guards the members below
  std::vector<Token> tokens_;
  std::optional<FileMark> mark_;
};

}  // namespace lenticule::web
