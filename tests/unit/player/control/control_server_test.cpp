// SPDX-License-Identifier: Apache-2.0
// Tests the control socket with a player that only records requests.
#include "player/control/control_server.h"

#include <fcntl.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/mman.h>
#include <sys/socket.h>
#include <sys/stat.h>

#include <cstring>
#include <filesystem>
#include <thread>

#include "base/unix_address.h"
#include "player/control/control_protocol.h"
#include "tests/support/comes_true.h"
#include "tests/support/scratch_folder.h"

namespace lenticule::player {
namespace {

namespace fs = std::filesystem;
using nlohmann::json;
using nlohmann::ordered_json;
using std::chrono::seconds;

constexpr auto kTimeout = seconds(30);

class FakePlayer final : public ControlTarget {
 public:
  void handle(const ControlRequest& request, ControlRights rights,
              std::function<void(ControlAnswer)> answer) override {
    const std::lock_guard lock(mutex_);
    verbs_.emplace_back(request.verb);
    rights_ = rights;
    if (request.verb == "seek")
      throw Error(ErrorKind::Failed, "seek: this player cannot", "let it be");
    if (request.verb == "back")
      answer(ConflictAnswer{{ErrorKind::Failed, "back: nothing is interrupted"}});
    else if (request.verb == "frame")
      answer(DescriptorAnswer{.body = {{"verb", "frame"}}, .descriptor = descriptor_});
    else if (request.verb == "load")
      later_.push_back(std::move(answer));
    else
      answer(ordered_json{{"verb", request.verb}, {"filler", filler_}});
    if (request.verb != "quit") return;
    quits_.store(true);
    // The server's end begins before its thread looks for the answer.
    std::this_thread::sleep_for(std::chrono::milliseconds(100));
  }
  [[nodiscard]] bool quits() const { return quits_.load(); }
  [[nodiscard]] std::vector<std::string> verbs() const {
    const std::lock_guard lock(mutex_);
    return verbs_;
  }
  [[nodiscard]] size_t waiting() const {
    const std::lock_guard lock(mutex_);
    return later_.size();
  }
  void answer_all() {
    const std::lock_guard lock(mutex_);
    for (const auto& answer : later_) answer(ordered_json{{"late", true}});
    later_.clear();
  }
  void pass_on(std::shared_ptr<const UniqueFd> descriptor) {
    const std::lock_guard lock(mutex_);
    descriptor_ = std::move(descriptor);
  }
  void fill_answers(size_t bytes) {
    const std::lock_guard lock(mutex_);
    filler_.assign(bytes, 'x');
  }

 private:
  mutable std::mutex mutex_;
  std::vector<std::string> verbs_;
  std::vector<std::function<void(ControlAnswer)>> later_;
  ControlRights rights_ = ControlRights::None;
  std::atomic<bool> quits_ = false;
  std::string filler_;
  std::shared_ptr<const UniqueFd> descriptor_;
};

class ControlSocket : public testing::Test {
 protected:
  test::ScratchFolder scratch;
  fs::path folder = scratch.path();
  std::string socket = (folder / "c.sock").string();
  FakePlayer player;
  std::unique_ptr<ControlServer> server;

  void serve(ControlServerOptions options = {}) {
    options.socket = socket;
    server = std::make_unique<ControlServer>(std::move(options), player);
  }
  [[nodiscard]] ControlClient client() const { return {socket, kTimeout}; }
  /// Returns a raw connection that need not follow the protocol.
  [[nodiscard]] UniqueFd raw() const {
    const UnixAddress address = unix_address(socket);
    UniqueFd fd(::socket(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0));
    EXPECT_EQ(::connect(fd.get(), address.get(), address.bytes), 0) << std::strerror(errno);
    const timeval timeout{.tv_sec = 30, .tv_usec = 0};
    (void)::setsockopt(fd.get(), SOL_SOCKET, SO_RCVTIMEO, &timeout, sizeof timeout);
    return fd;
  }
  static void say(const UniqueFd& fd, const std::string& text) {
    (void)::send(fd.get(), text.data(), text.size(), MSG_NOSIGNAL);
  }
  /// Reads up to the end of the connection.
  static std::string hear_all(const UniqueFd& fd) {
    std::string all;
    std::array<char, 4096> bytes{};
    ssize_t got = 0;
    while ((got = ::recv(fd.get(), bytes.data(), bytes.size(), 0)) > 0)
      all.append(bytes.data(), static_cast<size_t>(got));
    return all;
  }
  static json ask(ControlClient& client, const ordered_json& request) {
    client.send(request);
    const auto answer = client.receive(kTimeout);
    EXPECT_TRUE(answer);
    return answer ? json(*answer) : json();
  }
};

TEST_F(ControlSocket, AnswersWithTheIdOfTheRequest) {
  serve();
  ControlClient one = client();
  EXPECT_EQ(ask(one, {{"id", 1}, {"do", "status"}})["verb"], "status");
  const json refused = ask(one, {{"id", "b"}, {"do", "seek"}, {"frame", 1}});
  EXPECT_EQ(refused["id"], "b");
  EXPECT_EQ(refused["ok"], false);
  EXPECT_EQ(refused["error"]["cause"], "this player cannot");
  EXPECT_EQ(ask(one, {{"id", 2}, {"do", "fly"}})["error"]["object"], "do");
}

/// Reads once; returns the text and puts an arriving descriptor into `fd`.
std::string receive_with_descriptor(const UniqueFd& socket, UniqueFd& fd) {
  std::array<char, 4096> bytes{};
  iovec part{.iov_base = bytes.data(), .iov_len = bytes.size()};
  alignas(cmsghdr) std::array<char, CMSG_SPACE(4 * sizeof(int))> control{};
  msghdr message{};
  message.msg_iov = &part;
  message.msg_iovlen = 1;
  message.msg_control = control.data();
  message.msg_controllen = control.size();
  const ssize_t got = ::recvmsg(socket.get(), &message, MSG_CMSG_CLOEXEC);
  if (got <= 0) return {};
  if (const cmsghdr* const header = CMSG_FIRSTHDR(&message); header != nullptr) {
    EXPECT_EQ(header->cmsg_len, CMSG_LEN(sizeof(int))) << "one descriptor";
    int number = -1;
    std::memcpy(&number, CMSG_DATA(header), sizeof number);
    fd = UniqueFd(number);
  }
  return {bytes.data(), static_cast<size_t>(got)};
}

TEST_F(ControlSocket, EachDescriptorArrivesWithItsOwnAnswer) {
  serve();
  const auto shared = std::make_shared<const UniqueFd>(::memfd_create("control-test", MFD_CLOEXEC));
  struct stat ours {};
  ASSERT_EQ(::fstat(shared->get(), &ours), 0);
  player.pass_on(shared);
  const UniqueFd fd = raw();
  say(fd,
      "{\"id\":1,\"do\":\"status\"}\n{\"id\":2,\"do\":\"frame\"}\n"
      "{\"id\":3,\"do\":\"stats\"}\n{\"id\":4,\"do\":\"frame\"}\n");
  std::string all;
  int descriptors = 0;
  while (std::count(all.begin(), all.end(), '\n') < 4) {
    UniqueFd arrived;
    const std::string text = receive_with_descriptor(fd, arrived);
    ASSERT_FALSE(text.empty());
    all += text;
    if (!arrived) continue;
    ++descriptors;
    // The kernel may join the lines before the descriptor's with it, but none of another
    // descriptor.
    EXPECT_NE(text.find(descriptors == 1 ? "{\"id\":2" : "{\"id\":4"), std::string::npos) << text;
    EXPECT_EQ(text.find(descriptors == 1 ? "{\"id\":4" : "{\"id\":2"), std::string::npos) << text;
    struct stat theirs {};
    ASSERT_EQ(::fstat(arrived.get(), &theirs), 0);
    EXPECT_EQ(theirs.st_ino, ours.st_ino);
  }
  EXPECT_EQ(descriptors, 2);
}

TEST_F(ControlSocket, IsPrivateToItsOwnerAndRemovedWithThePlayer) {
  serve();
  struct stat status {};
  ASSERT_EQ(::stat(socket.c_str(), &status), 0);
  EXPECT_EQ(status.st_mode & 0777, 0600u);
  server.reset();
  EXPECT_FALSE(fs::exists(socket));
  serve({.group = getegid()});
  ASSERT_EQ(::stat(socket.c_str(), &status), 0);
  EXPECT_EQ(status.st_mode & 0777, 0660u);
}

TEST_F(ControlSocket, ReplacesADeadSocketAndNothingElse) {
  {
    const UnixAddress address = unix_address(socket);
    const UniqueFd dead(::socket(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0));
    ASSERT_EQ(::bind(dead.get(), address.get(), address.bytes), 0);
  }
  serve();
  FakePlayer other;
  EXPECT_THROW(ControlServer({.socket = socket}, other), Error) << "a live one";
  ControlClient still = client();
  EXPECT_EQ(ask(still, {{"do", "status"}})["ok"], true);
  const std::string file = (folder / "file").string();
  close(open(file.c_str(), O_CREAT | O_WRONLY | O_CLOEXEC, 0600));
  EXPECT_THROW(ControlServer({.socket = file}, other), Error);
  EXPECT_TRUE(fs::exists(file));
}

TEST_F(ControlSocket, StrangersAreRefusedAndDisconnected) {
  serve({.peer = [](int) { return ControlPeer{.uid = geteuid() + 1, .groups = {}}; }});
  const UniqueFd stranger = raw();
  say(stranger, "{\"do\":\"quit\"}\n");
  EXPECT_THAT(hear_all(stranger), testing::HasSubstr("the player belongs to another user"));
  EXPECT_TRUE(player.verbs().empty());
  EXPECT_EQ(server->counts().refused, 1u);
  server.reset();
  serve({.peer = [](int) -> std::optional<ControlPeer> { return std::nullopt; }});
  EXPECT_THAT(hear_all(raw()), testing::HasSubstr("the player belongs to another user"));
}

TEST_F(ControlSocket, PartialLinesWaitAndPipelinedOnesAreAnsweredInOrder) {
  serve();
  const UniqueFd slow = raw();
  say(slow, "{\"id\":1,\"do\":");
  ControlClient other = client();
  EXPECT_EQ(ask(other, {{"do", "stats"}})["verb"], "stats");
  std::string rest = "\"play\"}\n";
  for (int k = 2; k < 100; ++k) rest += "{\"id\":" + std::to_string(k) + ",\"do\":\"play\"}\r\n\n";
  say(slow, rest);
  ::shutdown(slow.get(), SHUT_WR);
  std::istringstream answers(hear_all(slow));
  int expected = 1;
  for (std::string line; std::getline(answers, line);)
    EXPECT_EQ(json::parse(line)["id"], expected++);
  EXPECT_EQ(expected, 100);
}

TEST_F(ControlSocket, GarbageIsAnsweredAndOverlongLinesEndTheConnection) {
  serve();
  const UniqueFd noisy = raw();
  say(noisy, "\xff\x01garbage\n{}\n[1,2]\n");
  say(noisy, std::string(2 * kMaxControlLine, 'a'));
  const std::string heard = hear_all(noisy);
  EXPECT_EQ(std::count(heard.begin(), heard.end(), '\n'), 4);
  EXPECT_THAT(heard, testing::HasSubstr("longer than"));
  ControlClient after = client();
  EXPECT_EQ(ask(after, {{"do", "status"}})["ok"], true);
}

TEST_F(ControlSocket, AThousandClientsAreServedOrTurnedAway) {
  serve();
  std::vector<UniqueFd> all;
  for (int k = 0; k < 1000; ++k) {
    UniqueFd fd = raw();
    say(fd, "{\"do\":\"status\"}\n");
    if (all.size() < 100) all.push_back(std::move(fd));
  }
  ASSERT_TRUE(test::comes_true([&] {
    const ControlCounts counts = server->counts();
    return counts.accepted + counts.refused == 1000;
  }));
  all.clear();
  ASSERT_TRUE(test::comes_true([&] {
    try {
      ControlClient after = client();
      return ask(after, {{"do", "status"}})["ok"] == true;
    } catch (const Error&) {
      return false;  // the server does not notice closed connections at once
    }
  }));
  EXPECT_GT(server->counts().displaced, 0u);
}

/// Makes every client a member of the group until `owner` is set.
struct Callers {
  std::atomic<bool> owner{false};
  [[nodiscard]] ControlServerOptions options() {
    return {.group = getegid(),
            .limits = {.clients = 4, .idle = std::chrono::milliseconds(0)},
            .peer = [this](int) {
              return ControlPeer{.uid = owner ? geteuid() : geteuid() + 1, .groups = {getegid()}};
            }};
  }
};

TEST_F(ControlSocket, TheLongestIdleClientIsReplacedByANewOne) {
  Callers callers;
  serve(callers.options());
  std::vector<ControlClient> all;
  for (int k = 0; k < 4; ++k) {
    all.push_back(client());
    EXPECT_EQ(ask(all.back(), {{"do", "stats"}})["ok"], true);
  }
  EXPECT_EQ(ask(all[0], {{"do", "stats"}})["ok"], true);
  ControlClient fifth = client();
  EXPECT_EQ(ask(fifth, {{"do", "status"}})["ok"], true);
  EXPECT_EQ(ask(all[0], {{"do", "stats"}})["ok"], true) << "it had asked after the second";
  EXPECT_EQ(ask(all[2], {{"do", "stats"}})["ok"], true);
  const auto rejection = all[1].receive(kTimeout);
  ASSERT_TRUE(rejection);
  EXPECT_EQ((*rejection)["error"]["cause"],
            "disconnected, because another client needed the connection");
  EXPECT_EQ(server->counts().displaced, 1u);
}

TEST_F(ControlSocket, SubscribersOutlastIdleClients) {
  Callers callers;
  serve(callers.options());
  ControlClient listener = client();
  EXPECT_EQ(ask(listener, {{"do", "subscribe"}})["subscribed"], true);
  std::vector<ControlClient> idle;
  for (int k = 0; k < 6; ++k) {
    idle.push_back(client());
    EXPECT_EQ(ask(idle.back(), {{"do", "stats"}})["ok"], true);
  }
  EXPECT_EQ(ask(listener, {{"do", "stats"}})["ok"], true);
}

TEST_F(ControlSocket, WithOnlyBusyClientsAGroupMemberIsRefusedAndTheOwnerIsNot) {
  Callers callers;
  serve(callers.options());
  std::vector<ControlClient> all;
  for (int k = 0; k < 4; ++k) {
    all.push_back(client());
    all.back().send({{"do", "load"}, {"source", "a"}});
    ASSERT_TRUE(test::comes_true([&] { return player.waiting() == static_cast<size_t>(k) + 1; }));
  }
  EXPECT_THAT(hear_all(raw()), testing::HasSubstr("connected and busy"));
  EXPECT_EQ(server->counts().refused, 1u);
  callers.owner = true;
  ControlClient owner = client();
  EXPECT_EQ(ask(owner, {{"do", "status"}})["ok"], true);
  EXPECT_EQ(server->counts().displaced, 1u);
}

TEST_F(ControlSocket, AClientThatSendsOnlySpacesIsIdle) {
  Callers callers;
  serve(callers.options());
  std::vector<UniqueFd> slow;
  for (int k = 0; k < 4; ++k) {
    slow.push_back(raw());
    say(slow.back(), "{");
  }
  for (int round = 0; round < 3; ++round) {
    for (const UniqueFd& fd : slow) say(fd, " ");
    ControlClient other = client();
    EXPECT_EQ(ask(other, {{"do", "status"}})["ok"], true);
  }
}

TEST_F(ControlSocket, AClientThatNeverReadsIsDroppedWithoutDelayingOthers) {
  serve({.limits = {.events_per_second = 1'000'000}});
  const UniqueFd deaf = raw();
  say(deaf, "{\"do\":\"subscribe\"}\n");
  ControlClient listener = client();
  EXPECT_EQ(ask(listener, {{"do", "subscribe"}})["subscribed"], true);
  const std::string large(16'000, 'e');
  for (int k = 0; k < 2000 && server->counts().dropped == 0; ++k) {
    server->publish({{"event", "noise"}, {"text", large}, {"n", k}});
    const auto heard = listener.receive(kTimeout);
    ASSERT_TRUE(heard);
    ASSERT_EQ((*heard)["n"], k) << "who reads misses nothing";
  }
  EXPECT_EQ(server->counts().dropped, 1u);
}

TEST_F(ControlSocket, RequestsOfAClientThatNeverReadsAreReadUpToALimit) {
  serve();
  player.fill_answers(10'000);
  const UniqueFd deaf = raw();
  ASSERT_EQ(::fcntl(deaf.get(), F_SETFL, O_NONBLOCK), 0);
  const std::string request = "{\"do\":\"status\"}\n";
  uint64_t sent = 0;
  ASSERT_TRUE(test::comes_true([&] {
    const ssize_t more = ::send(deaf.get(), request.data(), request.size(), MSG_NOSIGNAL);
    sent += more > 0 ? 1 : 0;
    return more < 0 && errno == EAGAIN;
  }));
  ControlClient other = client();
  EXPECT_EQ(ask(other, {{"do", "stats"}})["verb"], "stats");
  EXPECT_LT(player.verbs().size(), sent) << "not all of it was taken in";
}

TEST_F(ControlSocket, LateAnswersArriveUnlessTheirClientIsGone) {
  serve();
  {
    ControlClient gone = client();
    gone.send({{"id", 1}, {"do", "load"}, {"source", "a"}});
    ASSERT_TRUE(test::comes_true([&] { return player.waiting() == 1; }));
  }
  ControlClient stays = client();
  stays.send({{"id", 2}, {"do", "load"}, {"source", "b"}});
  ASSERT_TRUE(test::comes_true([&] { return player.waiting() == 2; }));
  EXPECT_EQ(ask(stays, {{"id", 3}, {"do", "status"}})["id"], 3) << "others are not held up";
  player.answer_all();
  const auto late = stays.receive(kTimeout);
  ASSERT_TRUE(late);
  EXPECT_EQ((*late)["id"], 2);
}

TEST_F(ControlSocket, ARequestThatThePlayerDoesNotAnswerGetsAnErrorAndItsLateAnswerIsLeftOut) {
  serve({.limits = {.opening = std::chrono::milliseconds(50)}});
  ControlClient one = client();
  one.send({{"id", 1}, {"do", "load"}, {"source", "a"}});
  const auto answer = one.receive(kTimeout);
  ASSERT_TRUE(answer);
  EXPECT_EQ((*answer)["id"], 1);
  EXPECT_EQ((*answer)["error"]["object"], "load");
  EXPECT_THAT((*answer)["error"]["cause"].get<std::string>(),
              testing::StartsWith("not done after"));
  player.answer_all();
  EXPECT_EQ(ask(one, {{"id", 2}, {"do", "status"}})["id"], 2);
}

TEST_F(ControlSocket, TheAnswerToTheRequestThatEndsTheServerArrives) {
  serve();
  ControlClient one = client();
  one.send({{"do", "quit"}});
  ASSERT_TRUE(test::comes_true([&] { return player.quits(); }));
  server.reset();
  const auto answer = one.receive(kTimeout);
  ASSERT_TRUE(answer);
  EXPECT_EQ((*answer)["verb"], "quit");
}

TEST_F(ControlSocket, AnswersAfterTheServersEndAreDropped) {
  serve();
  ControlClient one = client();
  one.send({{"do", "load"}, {"source", "a"}});
  ASSERT_TRUE(test::comes_true([&] { return player.waiting() == 1; }));
  server.reset();
  player.answer_all();
  EXPECT_THROW((void)one.receive(kTimeout), Error);
}

TEST_F(ControlSocket, SurplusEventsAreCountedInsteadOfSent) {
  serve({.limits = {.events_per_second = 5}});
  ControlClient listener = client();
  (void)ask(listener, {{"do", "subscribe"}});
  for (int k = 0; k < 200; ++k) server->publish({{"event", "seam"}, {"n", k}});
  uint64_t left_out = 0;
  uint64_t heard = 0;
  ASSERT_TRUE(test::comes_true([&] {
    server->publish({{"event", "last"}});
    while (const auto event = listener.receive(std::chrono::milliseconds(20))) {
      left_out += event->value("left_out", uint64_t{0});
      heard += event->value("event", "") == "seam" ? 1 : 0;
    }
    return left_out > 100;
  }));
  EXPECT_LE(heard, 100u);
}

}  // namespace
}  // namespace lenticule::player
