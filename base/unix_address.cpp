// SPDX-License-Identifier: Apache-2.0
#include "base/unix_address.h"

#include <cstring>

#include "base/error.h"

namespace lenticule {

UnixAddress unix_address(const std::filesystem::path& path) {
  const std::string& text = path.native();
  UnixAddress result;
  if (text.empty()) throw Error(ErrorKind::Usage, "the path of the socket is empty");
  if (text.size() >= sizeof result.address.sun_path)
    throw Error(ErrorKind::Usage,
                text + ": too long for a socket (" + std::to_string(text.size()) + " bytes)",
                "use a path of at most " + std::to_string(sizeof result.address.sun_path - 1) +
                    " bytes, for example below /run");
  result.address.sun_family = AF_UNIX;
  std::memcpy(result.address.sun_path, text.data(), text.size());
  result.bytes = static_cast<socklen_t>(offsetof(sockaddr_un, sun_path) + text.size() + 1);
  return result;
}

}  // namespace lenticule
