// SPDX-License-Identifier: Apache-2.0
// Tests the player's socket file: its mode, its removal, and an existing file at its place.
#include <gtest/gtest.h>
#include <sys/stat.h>
#include <unistd.h>

#include <atomic>
#include <chrono>
#include <fstream>
#include <thread>

#include "base/error.h"
#include "base/unix_address.h"
#include "frames/ring/listen_socket.h"
#include "tests/support/fakes/ring_peer.h"

namespace lenticule::frames {
namespace {

using test::SocketFolder;

std::optional<ErrorKind> kind_of_failure(const std::filesystem::path& path) {
  try {
    ListenSocket socket(path);
  } catch (const Error& error) {
    return error.kind();
  }
  return std::nullopt;
}

/// Leaves the socket file of a killed player, to which no process listens.
void leave_dead_socket(const std::filesystem::path& path) {
  UniqueFd fd(::socket(AF_UNIX, SOCK_SEQPACKET | SOCK_CLOEXEC, 0));
  const UnixAddress address = unix_address(path);
  ASSERT_EQ(::bind(fd.get(), address.get(), address.bytes), 0);
}

TEST(RingSocket, OnlyItsOwnerMayUseIt) {
  SocketFolder folder;
  const mode_t before = ::umask(0);
  ListenSocket socket(folder.socket());
  ::umask(before);
  struct stat status;
  ASSERT_EQ(::stat(folder.socket().c_str(), &status), 0);
  EXPECT_EQ(status.st_mode & 0777, 0600u);
}

TEST(RingSocket, AcceptsConnectionsAsSoonAsItsFileExists) {
  SocketFolder folder;
  const UnixAddress address = unix_address(folder.socket());
  for (int round = 0; round < 300; ++round) {
    int status = -1;
    std::atomic<bool> waits = false;
    std::thread renderer([&] {
      const UniqueFd fd(::socket(AF_UNIX, SOCK_SEQPACKET | SOCK_CLOEXEC, 0));
      const auto deadline = std::chrono::steady_clock::now() + std::chrono::seconds(20);
      waits = true;
      while (!std::filesystem::exists(folder.socket()) &&
             std::chrono::steady_clock::now() < deadline)
        continue;
      status = ::connect(fd.get(), address.get(), address.bytes);
    });
    while (!waits) std::this_thread::yield();
    const ListenSocket socket(folder.socket());
    renderer.join();
    ASSERT_EQ(status, 0) << "round " << round;
  }
}

TEST(RingSocket, LeavesNoOtherFileInItsFolder) {
  SocketFolder folder;
  ListenSocket socket(folder.socket());
  EXPECT_EQ(kind_of_failure(folder.socket()), ErrorKind::Device);
  for (const auto& entry : std::filesystem::directory_iterator(folder.folder()))
    EXPECT_EQ(entry.path(), folder.socket());
}

TEST(RingSocket, IsRemovedWithThePlayer) {
  SocketFolder folder;
  { ListenSocket socket(folder.socket()); }
  EXPECT_FALSE(std::filesystem::exists(folder.socket()));
}

TEST(RingSocket, LeavesASuccessorsFileAlone) {
  SocketFolder folder;
  auto first = std::make_unique<ListenSocket>(folder.socket());
  std::filesystem::rename(folder.socket(), folder.folder() / "moved");
  ListenSocket second(folder.socket());
  first.reset();
  EXPECT_TRUE(std::filesystem::exists(folder.socket()));
}

TEST(RingSocket, ReplacesTheSocketOfADeadPlayer) {
  SocketFolder folder;
  leave_dead_socket(folder.socket());
  ASSERT_TRUE(std::filesystem::exists(folder.socket()));
  EXPECT_EQ(kind_of_failure(folder.socket()), std::nullopt);
}

TEST(RingSocket, RefusesTheSocketOfALivePlayer) {
  SocketFolder folder;
  ListenSocket live(folder.socket());
  EXPECT_EQ(kind_of_failure(folder.socket()), ErrorKind::Device);
  EXPECT_TRUE(std::filesystem::exists(folder.socket())) << "and leaves it alone";
}

TEST(RingSocket, NeverRemovesAFileThatIsNotASocket) {
  SocketFolder folder;
  std::ofstream(folder.socket()) << "precious";
  EXPECT_EQ(kind_of_failure(folder.socket()), ErrorKind::Usage);
  EXPECT_EQ(std::filesystem::file_size(folder.socket()), 8u);
}

TEST(RingSocket, NamesAPathThatIsTooLongOrLeadsNowhere) {
  SocketFolder folder;
  EXPECT_EQ(kind_of_failure(folder.folder() / std::string(100, 'x')), ErrorKind::Usage);
  EXPECT_EQ(kind_of_failure({}), ErrorKind::Usage);
  EXPECT_EQ(kind_of_failure(folder.folder() / "none" / "ring"), ErrorKind::Failed);
  const size_t most = 107 - folder.folder().string().size() - 1;
  EXPECT_EQ(kind_of_failure(folder.folder() / std::string(most, 'x')), std::nullopt);
}

TEST(RingSocket, ExactlyOneOfManyPlayersThatStartTogetherWins) {
  SocketFolder folder;
  for (int round = 0; round < 10; ++round) {
    leave_dead_socket(folder.socket());
    std::vector<std::unique_ptr<ListenSocket>> winners(4);
    std::vector<std::thread> players;
    for (auto& winner : winners)
      players.emplace_back([&] {
        try {
          winner = std::make_unique<ListenSocket>(folder.socket());
        } catch (const Error&) {
        }
      });
    for (std::thread& player : players) player.join();
    EXPECT_EQ(std::count(winners.begin(), winners.end(), nullptr), 3);
    EXPECT_TRUE(test::knock(folder.socket())) << "and the winner can be reached";
  }
}

}  // namespace
}  // namespace lenticule::frames
