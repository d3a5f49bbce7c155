// SPDX-License-Identifier: Apache-2.0
// Lets a day of the server's clock pass in seconds, with a page open and others that poll: the
// memory of the process must not grow.
#include <gtest/gtest.h>
#include <malloc.h>
#include <unistd.h>

#include <atomic>
#include <fstream>
#include <thread>

#include "apps/lenticule-web/api/web_site.h"
#include "apps/lenticule-web/http/server.h"
#include "tests/support/scratch_folder.h"
#include "tests/unit/web/fake_player.h"
#include "tests/unit/web/http_client.h"

namespace lenticule::web {
namespace {

using std::chrono::milliseconds;
using test::FakePlayer;
using test::HttpAnswer;
using test::HttpClient;

#if defined(__SANITIZE_THREAD__) || defined(__SANITIZE_ADDRESS__)
constexpr bool kSanitized = true;
#elif defined(__has_feature)
constexpr bool kSanitized = __has_feature(thread_sanitizer) || __has_feature(address_sanitizer);
#else
constexpr bool kSanitized = false;
#endif

/// Time of a server that skips the waits between its own actions.
class FastClock final : public Clock {
 public:
  [[nodiscard]] Time now() const override { return Time(milliseconds(ms_.load())); }
  [[nodiscard]] int64_t date() const override { return 1'800'000'000 + ms_.load() / 1000; }
  void wait(std::condition_variable& changed, std::unique_lock<std::mutex>& lock, Time end,
            const std::function<bool()>& condition) override {
    while (!condition() && now() < end)
      if (changed.wait_for(lock, milliseconds(1)) == std::cv_status::timeout) ms_.fetch_add(1);
  }
  milliseconds idle(milliseconds span) override {
    ms_.fetch_add(span.count());
    return milliseconds(0);
  }
  [[nodiscard]] double hours() const { return static_cast<double>(ms_.load()) / 3.6e6; }

 private:
  std::atomic<int64_t> ms_{1000};
};

/// Memory of this process.
struct Memory {
  size_t heap_bytes = SIZE_MAX;  ///< allocated heap memory
  size_t resident_bytes = SIZE_MAX;
};

Memory memory_now() {
  std::ifstream file("/proc/self/statm");
  size_t all = 0, resident = 0;
  file >> all >> resident;
  const struct mallinfo2 heap = ::mallinfo2();
  return {.heap_bytes = heap.uordblks + heap.hblkhd,
          .resident_bytes = resident * static_cast<size_t>(::sysconf(_SC_PAGESIZE))};
}

class WebDay : public testing::Test {
 protected:
  void SetUp() override {
    std::filesystem::create_directories(folder_ / "media");
    player_ = std::make_unique<FakePlayer>(folder_ / "c.sock");
    token_ = add_token(folder_ / "tokens.json", "desk", Rights::Change).secret;
    access_ = std::make_unique<Access>(folder_ / "tokens.json");
    site_ = std::make_unique<WebSite>(WebSiteOptions{.socket = folder_ / "c.sock",
                                                     .state = folder_.path(),
                                                     .media = {.folder = folder_ / "media"},
                                                     .program = "/bin/false",
                                                     .clock = &clock_});
    std::vector<Listener> listeners;
    listeners.push_back(listen_tcp({.host = "127.0.0.1", .port = 0}, false));
    port_ = parse_listen_address(listeners.front().name).port;
    server_ =
        std::make_unique<Server>(std::move(listeners), *site_, *access_, ServerLimits{}, clock_);
  }
  void TearDown() override { site_->stop(); }

  /// Reads the events of an open page until the server ends; counts them.
  void watch() {
    HttpClient client(port_);
    client.say("GET /api/v1/events HTTP/1.1\r\nHost: panel\r\nAuthorization: Bearer " + token_ +
               "\r\n\r\n");
    while (!client.hear_until("\n\n").empty()) ++events_;
  }
  /// Polls as the pages do, one round; counts the answers that are not "success".
  void poll_once() {
    HttpClient client(port_);
    for (const char* address :
         {"/api/v1/state", "/api/v1/health", "/metrics", "/api/v1/frame.jpg?width=64",
          "/api/v1/eye.jpg?x=0&z=700&width=64", "/api/v1/list/versions", "/health", "/health.js"})
      if (client.ask("GET", address, {{"Authorization", "Bearer " + token_}}).status != 200)
        ++wrong_;
    polls_ += 8;
  }
  void pass_until(double hours) {
    while (clock_.hours() < hours) poll_once();
  }
  /// Returns the smallest of some measurements: answers that are being made take memory, too.
  [[nodiscard]] Memory memory() {
    Memory least;
    for (int n = 0; n < 40; ++n) {
      poll_once();
      const Memory now = memory_now();
      least.heap_bytes = std::min(least.heap_bytes, now.heap_bytes);
      least.resident_bytes = std::min(least.resident_bytes, now.resident_bytes);
    }
    return least;
  }

  test::ScratchFolder folder_;
  FastClock clock_;
  std::unique_ptr<FakePlayer> player_;
  std::string token_;
  std::unique_ptr<Access> access_;
  std::unique_ptr<WebSite> site_;
  std::unique_ptr<Server> server_;
  uint16_t port_ = 0;
  std::atomic<uint64_t> events_{0};
  uint64_t polls_ = 0;
  uint64_t wrong_ = 0;
};

TEST_F(WebDay, TwentyFourHoursWithAnOpenPageTakeNoMoreMemory) {
  // The histories and caches are full after three hours.
  const double full = kSanitized ? 0.02 : 3.0, end = kSanitized ? 0.1 : 24.0;
  std::thread page([this] { watch(); });
  pass_until(full);
  const Memory before = memory();
  pass_until(end);
  const Memory after = memory();
  site_->stop();
  page.join();
  EXPECT_EQ(site_->player().history().size(), kSanitized ? 7u : HourHistory::kMinutes);
  EXPECT_GT(player_->statuses(), static_cast<uint64_t>(end * 3000));
  EXPECT_GT(events_, player_->statuses() / 10) << "the open page received too few events";
  EXPECT_GT(polls_, 200u);
  EXPECT_EQ(wrong_, 0u);
  std::printf(
      "%.0f hours: %llu states, %llu events, %llu requests; heap %zu -> %zu, RSS %zu -> %zu\n",
      clock_.hours(), static_cast<unsigned long long>(player_->statuses()),
      static_cast<unsigned long long>(events_.load()), static_cast<unsigned long long>(polls_),
      before.heap_bytes, after.heap_bytes, before.resident_bytes, after.resident_bytes);
  if (kSanitized) return;  // a sanitizer keeps freed memory
  EXPECT_LT(after.heap_bytes, before.heap_bytes + (64u << 10));
  EXPECT_LT(after.resident_bytes, before.resident_bytes + (4u << 20));
}

}  // namespace
}  // namespace lenticule::web
