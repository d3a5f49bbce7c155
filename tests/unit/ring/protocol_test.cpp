// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>
#include <sys/socket.h>
#include <unistd.h>

#include <cstring>

#include "base/error.h"
#include "frames/ring/ring_protocol.h"

namespace lenticule::frames {
namespace {

template <typename Message>
std::span<const uint8_t> bytes_of(const Message& message) {
  return {reinterpret_cast<const uint8_t*>(&message), sizeof message};
}

RendererHello full_hello() {
  return {.name = "teapot",
          .rig_fingerprint = "0123456789abcdef",
          .rate = Rate{24000, 1001},
          .frame_count = 240};
}

std::string hello_problem(const HelloMessage& message) {
  RendererHello hello;
  const char* problem = read_hello(bytes_of(message), hello);
  return problem ? problem : "none";
}

TEST(RingProtocol, RatesArriveInLowestTerms) {
  HelloMessage message = make_hello({});
  message.rate_numerator = 120;
  message.rate_denominator = 4;
  RendererHello read;
  ASSERT_EQ(read_hello(bytes_of(message), read), nullptr);
  EXPECT_EQ(read.rate, (Rate{30, 1}));
}

TEST(RingProtocol, ChecksEveryFieldOfHello) {
  const HelloMessage good = make_hello(full_hello());
  EXPECT_EQ(hello_problem(good), "none");
  const auto with = [&](auto change) {
    HelloMessage message = good;
    change(message);
    return hello_problem(message);
  };
  EXPECT_EQ(with([](auto& m) { m.prefix.magic ^= 1; }), "not a ring message");
  EXPECT_EQ(with([](auto& m) { m.prefix.version = 2; }), "another protocol version");
  EXPECT_EQ(with([](auto& m) { m.prefix.kind = MessageKind::Accept; }), "unexpected message");
  EXPECT_EQ(with([](auto& m) { m.prefix.bytes = 16; }), "wrong length");
  EXPECT_EQ(with([](auto& m) { std::memset(m.name, 'n', sizeof m.name); }),
            "the name is not plain text");
  EXPECT_EQ(with([](auto& m) { m.name[1] = '\x1b'; }), "the name is not plain text");
  EXPECT_EQ(with([](auto& m) { std::memset(m.rig_fingerprint, 'a', sizeof m.rig_fingerprint); }),
            "the rig's fingerprint is not plain text");
  EXPECT_EQ(with([](auto& m) { m.has_frame_count = 2; }), "a reserved field is in use");
  EXPECT_EQ(with([](auto& m) { m.views = 2; }), "a reserved field is in use");
  const std::pair<int64_t, int64_t> senseless[] = {
      {0, 1}, {1, 0}, {-60, -1}, {10001, 1}, {1, 3601}, {INT64_MAX, INT64_MAX}, {INT64_MIN, 1}};
  for (const auto& rate : senseless)
    EXPECT_EQ(with([&](auto& m) {
                m.rate_numerator = rate.first;
                m.rate_denominator = rate.second;
              }),
              "the frame rate is out of range")
        << rate.first << "/" << rate.second;
}

TEST(RingProtocol, ARefusalOfAnotherVersionIsUnderstood) {
  RefuseMessage message = make_refuse(RefuseReason::OtherVersion, "speaks version 9");
  message.prefix.version = 9;
  RefuseReason reason{};
  std::string text;
  ASSERT_EQ(read_refuse(bytes_of(message), reason, text), nullptr);
  EXPECT_EQ(reason, RefuseReason::OtherVersion);
  EXPECT_EQ(text, "speaks version 9");
}

TEST(RingProtocol, ChecksARefusal) {
  RefuseReason reason{};
  std::string text;
  RefuseMessage message = make_refuse(RefuseReason::Busy, std::string(1000, 'b'));
  ASSERT_EQ(read_refuse(bytes_of(message), reason, text), nullptr);
  EXPECT_EQ(text.size(), sizeof message.text - 1) << "cut, not overrun";
  message.reason = static_cast<RefuseReason>(99);
  EXPECT_STREQ(read_refuse(bytes_of(message), reason, text), "unknown reason");
  message = make_refuse(RefuseReason::Busy, "\x1b[2J");
  EXPECT_STREQ(read_refuse(bytes_of(message), reason, text), "the reason is not plain text");
}

TEST(RingProtocol, ChecksAnAcceptance) {
  AcceptMessage read;
  EXPECT_EQ(read_accept(bytes_of(make_accept(4096, 1)), read), nullptr);
  EXPECT_NE(read_accept(bytes_of(make_accept(4096, 0)), read), nullptr);
  EXPECT_NE(read_accept(bytes_of(make_accept(4096, kMaxEpoch + 1)), read), nullptr);
  EXPECT_NE(read_accept(bytes_of(make_goodbye(1)), read), nullptr);
}

class SocketPair : public testing::Test {
 protected:
  SocketPair() {
    int fds[2];
    if (::socketpair(AF_UNIX, SOCK_SEQPACKET | SOCK_CLOEXEC, 0, fds) == 0) {
      near_ = UniqueFd(fds[0]);
      far_ = UniqueFd(fds[1]);
    }
  }
  UniqueFd near_, far_;
};

TEST_F(SocketPair, NeverBlocks) {
  Packet packet;
  EXPECT_EQ(receive_packet(far_.get(), packet, PassedFds::Ignore), Transfer::WouldBlock);
  Transfer transfer = Transfer::Done;
  for (int i = 0; i < 100000 && transfer == Transfer::Done; ++i)
    transfer = send_message(near_.get(), make_wake(MessageKind::Freed));
  EXPECT_EQ(transfer, Transfer::WouldBlock) << "a full queue";
}

TEST_F(SocketPair, ReceivesTheLastMessageOfAPeerThatLeftUnreadMessages) {
  ASSERT_EQ(send_message(far_.get(), make_wake(MessageKind::Freed)), Transfer::Done);
  ASSERT_EQ(send_message(near_.get(), make_goodbye(5)), Transfer::Done);
  near_.reset();
  Packet packet;
  ASSERT_EQ(receive_packet(far_.get(), packet, PassedFds::Ignore), Transfer::Done);
  uint64_t published = 0;
  EXPECT_EQ(read_goodbye(packet.bytes(), published), nullptr);
  EXPECT_EQ(published, 5u);
  EXPECT_EQ(receive_packet(far_.get(), packet, PassedFds::Ignore), Transfer::Closed);
  EXPECT_EQ(send_message(far_.get(), make_goodbye(5)), Transfer::Closed) << "and no SIGPIPE";
}

}  // namespace
}  // namespace lenticule::frames
