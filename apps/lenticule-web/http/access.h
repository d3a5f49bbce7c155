// SPDX-License-Identifier: Apache-2.0
// Access decides what the sender of a request may do. A token of 128 bits, in the address that a
// user opens, is exchanged for a cookie; programs send the token itself. Tokens are in a file of
// mode 0600 in the state folder.
#pragma once

#include <filesystem>
#include <mutex>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "base/file.h"

namespace lenticule::web {

enum class Rights { None, See, Change };

[[nodiscard]] const char* rights_name(Rights rights);
[[nodiscard]] std::optional<Rights> rights_named(std::string_view name);

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

/// Reads the tokens; none if the file does not exist. Throws Error(Input) for a file that is not
/// valid.
[[nodiscard]] std::vector<Token> read_tokens(const std::filesystem::path& file);
/// Adds a token with a new random secret, and returns it. Throws Error(Failed).
Token add_token(const std::filesystem::path& file, const std::string& name, Rights rights);
/// Removes the token with that id. Throws Error(Usage) if there is none.
void revoke_token(const std::filesystem::path& file, const std::string& id);

/// Compares in a time that depends on the lengths only.
[[nodiscard]] bool equal_secrets(std::string_view one, std::string_view other);

/// Thread safety: any thread.
class Access {
 public:
  /// Throws as read_tokens() does. Tokens that are added or revoked later take effect at once. If
  /// the file cannot be read then, no token is valid.
  explicit Access(std::filesystem::path tokens);

  /// Returns the identity of a token; rights None if it is not valid.
  [[nodiscard]] Identity with_token(std::string_view secret);
  /// Returns the identity of a cookie; rights None if it is not valid.
  [[nodiscard]] Identity with_cookie(std::string_view value);
  /// Returns true if the token with that id was not revoked.
  [[nodiscard]] bool is_valid(std::string_view token_id);
  /// Returns the cookie of a valid token. The cookie does not contain the token, and is valid as
  /// long as the token, also after a restart of the server.
  [[nodiscard]] std::string cookie_of(std::string_view secret);

 private:
  void refresh();

  const std::filesystem::path file_;
  std::mutex mutex_;  ///< guards the members below
  std::vector<Token> tokens_;
  std::optional<FileMark> mark_;
};

}  // namespace lenticule::web
