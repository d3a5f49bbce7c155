// SPDX-License-Identifier: Apache-2.0
// Tests the messages to a service manager, over a socket of the test's own.

#include <fcntl.h>
#include <gtest/gtest.h>
#include <poll.h>
#include <sys/mman.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <sys/un.h>
#include <sys/wait.h>
#include <unistd.h>

#include <array>
#include <cstdlib>
#include <cstring>
#include <string>
#include <vector>

#include "display/kms/scanout/kms_display.h"
#include "player/session/play_service.h"
#include "tests/support/scratch_folder.h"

namespace lenticule::player {
namespace {

constexpr int kTimeoutMs = 5000;

struct Message {
  std::string text;
  UniqueFd fd;
};

/// The service manager's end of $NOTIFY_SOCKET.
class ListeningManager {
 public:
  ListeningManager() : socket_(::socket(AF_UNIX, SOCK_DGRAM | SOCK_CLOEXEC, 0)) {
    const std::string path = folder_ / "socket";
    sockaddr_un address{};
    address.sun_family = AF_UNIX;
    std::strncpy(address.sun_path, path.c_str(), sizeof(address.sun_path) - 1);
    EXPECT_EQ(bind(socket_.get(), reinterpret_cast<const sockaddr*>(&address), sizeof(address)), 0);
    setenv("NOTIFY_SOCKET", path.c_str(), 1);
  }
  ~ListeningManager() {
    for (const char* name : {"NOTIFY_SOCKET", "WATCHDOG_USEC", "WATCHDOG_PID"}) unsetenv(name);
  }
  ListeningManager(const ListeningManager&) = delete;
  ListeningManager& operator=(const ListeningManager&) = delete;

  [[nodiscard]] bool heard_something() const {
    pollfd entry{.fd = socket_.get(), .events = POLLIN, .revents = 0};
    return poll(&entry, 1, 0) > 0;
  }

  Message next() {
    pollfd entry{.fd = socket_.get(), .events = POLLIN, .revents = 0};
    if (poll(&entry, 1, kTimeoutMs) <= 0) return {.text = "nothing came", .fd = {}};
    std::array<char, 4096> text{};
    alignas(cmsghdr) std::array<char, CMSG_SPACE(sizeof(int))> control{};
    iovec part{.iov_base = text.data(), .iov_len = text.size()};
    msghdr header{};
    header.msg_iov = &part;
    header.msg_iovlen = 1;
    header.msg_control = control.data();
    header.msg_controllen = control.size();
    const ssize_t size = recvmsg(socket_.get(), &header, MSG_CMSG_CLOEXEC);
    Message message{
        .text = std::string(text.data(), static_cast<size_t>(std::max<ssize_t>(size, 0))),
        .fd = {}};
    for (cmsghdr* c = CMSG_FIRSTHDR(&header); c != nullptr; c = CMSG_NXTHDR(&header, c)) {
      if (c->cmsg_type != SCM_RIGHTS) continue;
      int fd = -1;
      std::memcpy(&fd, CMSG_DATA(c), sizeof(fd));
      message.fd = UniqueFd(fd);
    }
    return message;
  }

 private:
  UniqueFd socket_;
  test::ScratchFolder folder_;
};

UniqueFd memory_file(const std::vector<uint8_t>& bytes) {
  UniqueFd file(memfd_create("test", MFD_CLOEXEC));
  EXPECT_EQ(write(file.get(), bytes.data(), bytes.size()), static_cast<ssize_t>(bytes.size()));
  return file;
}

bool same_file(int one, int other) {
  struct stat a {};
  struct stat b {};
  return fstat(one, &a) == 0 && fstat(other, &b) == 0 && a.st_ino == b.st_ino;
}

TEST(ServiceManager, SendsNothingOutsideAService) {
  unsetenv("NOTIFY_SOCKET");
  const ServiceManager manager;
  EXPECT_FALSE(manager.present());
  EXPECT_FALSE(manager.watchdog());
  manager.ready("x");
  manager.keep("x", 0);
}

TEST(ServiceManager, ReportsStatusReadyWatchdogAndStopping) {
  ListeningManager listener;
  const ServiceManager manager;
  ASSERT_TRUE(manager.present());
  manager.status("opening");
  EXPECT_EQ(listener.next().text, "STATUS=opening");
  manager.ready("playing");
  EXPECT_EQ(listener.next().text, "READY=1\nSTATUS=playing");
  manager.ping();
  EXPECT_EQ(listener.next().text, "WATCHDOG=1");
  manager.stopping("finished");
  EXPECT_EQ(listener.next().text, "STOPPING=1\nSTATUS=finished");
}

TEST(ServiceManager, EscapesLineEndsInAStatus) {
  ListeningManager listener;
  ServiceManager().status("panel 'x'\nWATCHDOG=1");
  EXPECT_EQ(listener.next().text, "STATUS=panel 'x'\\x0aWATCHDOG=1");
}

TEST(ServiceManager, ReadsTheWatchdogIntervalForItsOwnProcess) {
  ListeningManager listener;
  EXPECT_FALSE(ServiceManager().watchdog());
  setenv("WATCHDOG_USEC", "10000000", 1);
  EXPECT_EQ(ServiceManager().watchdog(), std::chrono::seconds(10));
  setenv("WATCHDOG_PID", "1", 1);  // meant for another process
  EXPECT_FALSE(ServiceManager().watchdog());
}

TEST(ServiceManager, ReplacesAStoredDescriptorOfTheSameName) {
  ListeningManager listener;
  const UniqueFd file = memory_file({1, 2, 3});
  ServiceManager().keep("card", file.get());
  EXPECT_EQ(listener.next().text, "FDSTOREREMOVE=1\nFDNAME=card");
  const Message kept = listener.next();
  EXPECT_EQ(kept.text, "FDSTORE=1\nFDNAME=card");
  EXPECT_TRUE(same_file(kept.fd.get(), file.get()));
}

TEST(StoredDescriptors, AreReturnedOnceWithTheirNames) {
  const UniqueFd file = memory_file({7});
  const pid_t child = fork();
  if (child == 0) {  // systemd passes descriptors from number 3 on
    const int high = fcntl(file.get(), F_DUPFD, 100);
    const bool placed = dup2(high, 3) == 3 && dup2(high, 4) == 4;
    setenv("LISTEN_PID", std::to_string(getpid()).c_str(), 1);
    setenv("LISTEN_FDS", "2", 1);
    setenv("LISTEN_FDNAMES", "card:state", 1);
    const auto kept = take_stored_descriptors();
    const bool right = kept.size() == 2 && kept[0].name == "card" && kept[1].name == "state" &&
                       kept[0].fd.get() == 3 && kept[1].fd.get() == 4 &&
                       (fcntl(3, F_GETFD) & FD_CLOEXEC) != 0;
    _exit(placed && right && take_stored_descriptors().empty() ? 0 : 1);
  }
  int status = -1;
  ASSERT_EQ(waitpid(child, &status, 0), child);
  EXPECT_TRUE(WIFEXITED(status) && WEXITSTATUS(status) == 0) << status;
}

TEST(StoredDescriptors, AreNoneWithoutAService) { EXPECT_TRUE(take_stored_descriptors().empty()); }

display::TakeoverState plausible_state() {
  display::TakeoverState state;
  state.connector = 31;
  state.crtc = 32;
  state.plane = 33;
  state.width = 64;
  state.height = 36;
  state.buffer_count = 2;
  for (uint32_t i = 0; i < 2; ++i)
    state.buffers.at(i) = {
        .handle = i + 1, .framebuffer = i + 41, .pitch = 256, .size = uint64_t{256} * 36};
  std::strcpy(state.card.data(), "/dev/dri/card0");
  return state;
}

std::vector<StoredDescriptor> kept(const std::vector<uint8_t>& state) {
  std::vector<StoredDescriptor> descriptors;
  descriptors.push_back({"lenticule-card", memory_file({0})});
  descriptors.push_back({"lenticule-output", memory_file(state)});
  descriptors.push_back({"stored by somebody", memory_file({0})});
  return descriptors;
}

TEST(StoredOutput, IsTheStoredState) {
  const display::TakeoverState state = plausible_state();
  const auto bytes = display::bytes_of(state);
  const auto output = stored_output(kept({bytes.begin(), bytes.end()}));
  ASSERT_NE(output, nullptr);
  EXPECT_EQ(output->state, state);
  EXPECT_TRUE(output->card);
}

TEST(StoredOutput, IsEmptyIfAnythingIsInconsistent) {
  EXPECT_EQ(stored_output({}), nullptr);
  EXPECT_EQ(stored_output(kept({})), nullptr);
  const display::TakeoverState state = plausible_state();
  const auto bytes = display::bytes_of(state);
  std::vector<uint8_t> changed(bytes.begin(), bytes.end());
  changed.pop_back();
  EXPECT_EQ(stored_output(kept(changed)), nullptr) << "too short";
  changed.assign(bytes.begin(), bytes.end());
  changed.push_back(0);
  EXPECT_EQ(stored_output(kept(changed)), nullptr) << "too long";
  changed.assign(bytes.begin(), bytes.end());
  changed.front() ^= 1;
  EXPECT_EQ(stored_output(kept(changed)), nullptr) << "not a state";
}

TEST(Watchdog, PingsWhileTheDisplayRunsOrItsPanelIsAway) {
  const auto pings_at = [](const ProgressSample& next) {
    Watchdog watchdog;
    EXPECT_TRUE(watchdog.should_ping({.flips = 10, .vblanks = 10}));
    return watchdog.should_ping(next);
  };
  EXPECT_TRUE(pings_at({.flips = 20, .vblanks = 20, .failures = 3}));
  EXPECT_TRUE(pings_at({.flips = 10, .vblanks = 300})) << "no frame was due";
  EXPECT_FALSE(pings_at({.flips = 10, .vblanks = 10})) << "the display's clock stands still";
  EXPECT_FALSE(pings_at({.flips = 10, .vblanks = 300, .failures = 4})) << "every flip fails";
  EXPECT_TRUE(pings_at({.flips = 10, .vblanks = 10, .failures = 4, .panel_away = true}));
}

TEST(Watchdog, StopsWhenADueFrameDoesNotComeForAReasonOfThisProcess) {
  Watchdog watchdog;
  PlayReport report;
  report.pace.shown = 10;
  const auto should_ping = [&] {
    ++report.wake.count;
    return watchdog.should_ping(progress_sample(report, nullptr));
  };
  EXPECT_TRUE(should_ping());
  report.delays.source = 1.5;
  EXPECT_TRUE(should_ping()) << "one late frame";
  report.delays.source = 3;
  EXPECT_FALSE(should_ping());
  report.delays.source_waits_for_others = true;
  EXPECT_TRUE(should_ping()) << "a restart brings no renderer";
  report.delays.frame_copier = 3;
  EXPECT_FALSE(should_ping());
  report.off = true;
  EXPECT_TRUE(should_ping());
}

TEST(PlayService, IsReadyWithTheFirstPicture) {
  ListeningManager listener;
  const ServiceManager manager;
  PlayService service(manager, nullptr);
  PlayReport report;
  service.report(report);
  EXPECT_FALSE(listener.heard_something());
  report.first_frame_ms = 12;
  report.pace.shown = 3;
  report.display = "virtual 64x36@60";
  service.report(report);
  EXPECT_EQ(listener.next().text,
            "READY=1\nSTATUS=3 frames shown, 0 underruns, 0 missed vblanks; virtual 64x36@60");
  service.report(report);
  EXPECT_EQ(listener.next().text.substr(0, 7), "STATUS=");
}

TEST(PlayService, StatusNamesVerdictAndPanel) {
  const display::KmsStatistics kms{.panel = display::PanelState::Disconnected};
  const display::ExactnessReport exactness{.verdict = display::Verdict::No, .reasons = {"gamma"}};
  const std::string text = status_text(PlayReport{}, &kms, &exactness);
  EXPECT_NE(text.find("EXACT no (gamma)"), std::string::npos) << text;
  EXPECT_NE(text.find("panel disconnected"), std::string::npos) << text;
}

TEST(PlayService, AnOutputThatIsSwitchedOffSatisfiesTheWatchdogAndIsNamed) {
  PlayReport report;
  report.off = true;
  const display::KmsStatistics kms{.panel = display::PanelState::Showing};
  EXPECT_TRUE(progress_sample(report, &kms).panel_away);
  EXPECT_TRUE(progress_sample(report, nullptr).panel_away);
  EXPECT_FALSE(progress_sample(PlayReport{}, &kms).panel_away);
  EXPECT_NE(status_text(report, &kms, nullptr).find("output off"), std::string::npos);
}

TEST(PlayService, CountsTheCardsFailuresForTheWatchdog) {
  PlayReport report;
  report.pace.shown = 5;
  const display::KmsStatistics kms{.flips = 4, .busy = 1, .refused = 2, .flip_timeouts = 3};
  EXPECT_EQ(progress_sample(report, nullptr).flips, 5U);
  EXPECT_EQ(progress_sample(report, &kms).flips, 4U);
  EXPECT_EQ(progress_sample(report, &kms).failures, 6U);
}

}  // namespace
}  // namespace lenticule::player
