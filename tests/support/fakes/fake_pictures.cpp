// SPDX-License-Identifier: Apache-2.0
// Replaces lenticule-pictures in tests of pictures whose decoder breaks, hangs or lies. The text of
// the "picture" selects the behaviour; one that begins with "well" has 2x1 pixels 1 2 3 4 5 6.
#include <sys/mman.h>
#include <sys/socket.h>
#include <unistd.h>

#include <array>
#include <atomic>
#include <csignal>
#include <cstdlib>
#include <cstring>
#include <limits>
#include <map>
#include <string>

#include "frames/pictures/picture_messages.h"

namespace {

using namespace lenticule::frames::confined;

void reply(const PictureReplyMessage& message) {
  if (::send(kPictureSocket, &message, sizeof message, MSG_NOSIGNAL) != sizeof message) _exit(0);
}

/// Returns the text of the file that comes with a request to decode.
std::string take_request() {
  while (true) {
    PictureRequestMessage message;
    iovec part{.iov_base = &message, .iov_len = sizeof message};
    alignas(cmsghdr) std::array<char, CMSG_SPACE(sizeof(int))> control{};
    msghdr header{};
    header.msg_iov = &part;
    header.msg_iovlen = 1;
    header.msg_control = control.data();
    header.msg_controllen = control.size();
    if (::recvmsg(kPictureSocket, &header, 0) != sizeof message) _exit(0);
    const cmsghdr* const passed = CMSG_FIRSTHDR(&header);
    if (passed == nullptr) continue;  // the answer to a header or to rows
    int file = -1;
    std::memcpy(&file, CMSG_DATA(passed), sizeof file);
    std::array<char, 64> text{};
    const ssize_t n = ::pread(file, text.data(), text.size(), 0);
    ::close(file);
    return {text.data(), static_cast<size_t>(n > 0 ? n : 0)};
  }
}

const PictureReplyMessage kHeader{.reply = PictureReply::Header, .width = 2, .height = 1};
const PictureReplyMessage kRow{.reply = PictureReply::Rows, .first_row = 0, .rows = 1};

/// Answers that no decoder gives.
const std::map<std::string, PictureReplyMessage> kLies = {
    {"lies about the width", {.reply = PictureReply::Header, .width = 40'000, .height = 1}},
    {"lies about the area", {.reply = PictureReply::Header, .width = 32'768, .height = 32'768}},
    {"lies about the pixels",
     {.reply = PictureReply::Header, .width = 2, .height = 1, .pixel_bytes = 1u << 31}},
    {"lies about the aspect",
     {.reply = PictureReply::Header,
      .width = 2,
      .height = 1,
      .pixel_aspect = std::numeric_limits<double>::quiet_NaN()}},
    {"lies about the orientation",
     {.reply = PictureReply::Header, .width = 2, .height = 1, .orientation = 9}},
    {"answers with a number", {.reply = static_cast<PictureReply>(77)}},
    {"sends rows first", kRow},
};
const std::map<std::string, PictureReplyMessage> kFalseRows = {
    {"sends too many rows", {.reply = PictureReply::Rows, .first_row = 0, .rows = 1 << 30}},
    {"sends no rows", {.reply = PictureReply::Rows, .first_row = 0, .rows = 0}},
    {"sends rows below", {.reply = PictureReply::Rows, .first_row = 1, .rows = 1}},
    {"sends rows from nowhere",
     {.reply = PictureReply::Rows, .first_row = 0, .rows = 1, .half = 1u << 20}},
    {"ends early", {.reply = PictureReply::Done}},
};

void answer(const std::string& what, uint8_t* memory) {
  if (what.starts_with("crash")) std::abort();
  if (what.starts_with("leave")) _exit(0);
  if (what.starts_with("stop")) std::raise(SIGSTOP);
  if (what.starts_with("spin"))
    for (std::atomic<int> n = 0;; ++n) continue;
  if (what.starts_with("short")) (void)!::write(kPictureSocket, "abc", 3);
  if (const auto lie = kLies.find(what); lie != kLies.end()) return reply(lie->second);
  reply(kHeader);
  if (const auto lie = kFalseRows.find(what); lie != kFalseRows.end()) return reply(lie->second);
  for (uint8_t n = 0; n < 6; ++n) memory[n] = n + 1;
  reply(kRow);
  reply({.reply = PictureReply::Done});
}

}  // namespace

int main() {
  void* const memory =
      ::mmap(nullptr, kMemoryBytes, PROT_READ | PROT_WRITE, MAP_SHARED, kPictureMemory, 0);
  if (memory == MAP_FAILED) return 1;
  reply({.reply = PictureReply::Idle});
  while (true) answer(take_request(), static_cast<uint8_t*>(memory));
}
