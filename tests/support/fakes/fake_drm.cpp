// SPDX-License-Identifier: Apache-2.0
#include "fake_drm.h"

#include <poll.h>
#include <sys/eventfd.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>

#include "base/error.h"

namespace lenticule::test {
namespace {

FakeDrm* the_machine = nullptr;

constexpr uint64_t kMapOffsetUnit = uint64_t{1} << 32;

bool readable(int fd) {
  pollfd entry{.fd = fd, .events = POLLIN, .revents = 0};
  return fd >= 0 && poll(&entry, 1, 0) == 1;
}

/// A clock of simulated time: waiting advances it from event to event.
class FakeClock final : public display::Clock {
 public:
  explicit FakeClock(FakeDrm& machine) : machine_(machine) {}
  [[nodiscard]] Nanoseconds now() const noexcept override { return machine_.now(); }
  [[nodiscard]] display::WaitResult wait_until(Nanoseconds deadline,
                                               int wake_fd) noexcept override {
    while (!readable(wake_fd)) {
      if (machine_.now() >= deadline) return display::WaitResult::Reached;
      const auto next = machine_.next_happening();
      machine_.advance_to(std::min(deadline, next.value_or(deadline)));
    }
    return display::WaitResult::Woken;
  }
  [[nodiscard]] bool real_time() const noexcept override { return false; }

 private:
  FakeDrm& machine_;
};

class FakeSession final : public display::Session {
 public:
  explicit FakeSession(FakeDrm& machine) : machine_(machine) {}
  [[nodiscard]] UniqueFd open_device(const std::string& path) override {
    FakeCard* card = machine_.card_at(path);
    if (card == nullptr || card->gone)
      throw Error(ErrorKind::Device, path + ": No such file or directory");
    if (card->forbidden) throw Error(ErrorKind::Device, path + ": Permission denied");
    return UniqueFd(card->open_end());
  }
  void close_device(int fd) noexcept override {
    if (FakeCard* card = machine_.card_of(fd)) card->closed(fd);
  }
  [[nodiscard]] display::Mastership ensure_master(int fd) noexcept override {
    FakeCard* card = machine_.card_of(fd);
    if (card == nullptr || card->gone) return display::Mastership::Denied;
    if (const int error = card->fail_with(card->set_master_faults); error != 0)
      return error == EBUSY ? display::Mastership::Busy : display::Mastership::Denied;
    if (card->foreign_master) return display::Mastership::Busy;
    if (card->master_fd < 0) card->master_fd = fd;
    return card->master_fd == fd ? display::Mastership::Held : display::Mastership::Busy;
  }
  void drop_master(int fd) noexcept override {
    if (FakeCard* card = machine_.card_of(fd); card != nullptr && card->master_fd == fd)
      card->master_fd = -1;
  }

 private:
  FakeDrm& machine_;
};

}  // namespace

class FakeMonitor final : public display::HotplugMonitor {
 public:
  explicit FakeMonitor(FakeDrm& machine) : machine_(machine) {}
  [[nodiscard]] int fd() const noexcept override { return machine_.hotplug_fd_; }
  [[nodiscard]] bool drain() noexcept override {
    uint64_t count = 0;
    return read(machine_.hotplug_fd_, &count, sizeof(count)) > 0;
  }

 private:
  FakeDrm& machine_;
};

class FakePlatform final : public display::KmsPlatform {
 public:
  explicit FakePlatform(FakeDrm& machine) : machine_(machine) {}
  [[nodiscard]] void* map(int fd, uint64_t offset, size_t size) noexcept override {
    FakeCard* card = machine_.card_of(fd);
    const auto buffer = card == nullptr
                            ? decltype(card->buffers.end()){}
                            : card->buffers.find(static_cast<uint32_t>(offset / kMapOffsetUnit));
    if (machine_.map_skip_ > 0) {
      --machine_.map_skip_;
    } else if (machine_.map_failures_ > 0) {
      --machine_.map_failures_;
      errno = ENOMEM;
      return nullptr;
    }
    if (card == nullptr || buffer == card->buffers.end() || size > buffer->second.bytes.size()) {
      errno = EINVAL;
      return nullptr;
    }
    ++machine_.mappings_alive;
    return buffer->second.bytes.data();
  }
  void unmap(void* memory, size_t size) noexcept override {
    (void)memory;
    (void)size;
    --machine_.mappings_alive;
  }
  [[nodiscard]] Nanoseconds time_asleep() const noexcept override { return machine_.asleep_; }
  [[nodiscard]] std::unique_ptr<display::HotplugMonitor> watch_hotplug() override {
    if (machine_.no_hotplug_monitor) throw Error(ErrorKind::Failed, "no more descriptors");
    return std::make_unique<FakeMonitor>(machine_);
  }
  [[nodiscard]] std::optional<std::string> read_kernel_file(const std::string& path) override {
    const std::lock_guard lock(machine_.kernel_files_mutex);
    const auto found = machine_.kernel_files.find(path);
    if (found == machine_.kernel_files.end()) return std::nullopt;
    return found->second;
  }
  [[nodiscard]] std::shared_ptr<display::TerminalCalls> terminal() override {
    return machine_.terminal;
  }

 private:
  FakeDrm& machine_;
};

int FakeTerminal::open_controlling_terminal() noexcept {
  if (open_error != 0) return -open_error;
  ++opened;
  return 7;
}
void FakeTerminal::close(int fd) noexcept {
  LENTICULE_CHECK(fd == 7);
  --opened;
}
bool FakeTerminal::is_foreground(int fd) noexcept { return fd == 7 && foreground; }
int FakeTerminal::get_mode(int fd, int& is) noexcept {
  LENTICULE_CHECK(fd == 7);
  is = mode;
  return -get_error;
}
int FakeTerminal::set_mode(int fd, int to) noexcept {
  LENTICULE_CHECK(fd == 7);
  if (set_error != 0) return -set_error;
  mode = to;
  set_.at(sets_++) = to;
  if (on_set) on_set(to);
  return 0;
}

FakeDrm::FakeDrm() : hotplug_fd_(eventfd(0, EFD_NONBLOCK | EFD_CLOEXEC)) {
  LENTICULE_CHECK(the_machine == nullptr);
  the_machine = this;
}

FakeDrm::~FakeDrm() {
  ::close(hotplug_fd_);
  the_machine = nullptr;
}

FakeDrm& FakeDrm::instance() {
  LENTICULE_CHECK(the_machine != nullptr);
  return *the_machine;
}

FakeCard& FakeDrm::add_card(const std::string& path, const std::string& driver) {
  cards.push_back(std::make_unique<FakeCard>(path, driver));
  return *cards.back();
}

std::shared_ptr<display::Clock> FakeDrm::clock() { return std::make_shared<FakeClock>(*this); }
std::shared_ptr<display::Session> FakeDrm::session() {
  return std::make_shared<FakeSession>(*this);
}
std::shared_ptr<display::KmsPlatform> FakeDrm::platform() {
  return std::make_shared<FakePlatform>(*this);
}

FakeCard* FakeDrm::card_of(int fd) {
  for (const auto& card : cards)
    if (card->owns(fd)) return card.get();
  return nullptr;
}

FakeCard* FakeDrm::card_at(const std::string& path) {
  for (const auto& card : cards)
    if (card->path == path) return card.get();
  return nullptr;
}

std::optional<Nanoseconds> FakeDrm::next_happening() const {
  std::optional<Nanoseconds> next;
  if (!plans_.empty()) next = plans_.begin()->first;
  for (const auto& card : cards)
    if (const auto event = card->next_event()) next = std::min(next.value_or(*event), *event);
  return next;
}

void FakeDrm::advance_to(Nanoseconds time) {
  now_ = std::max(now_, time);
  for (const auto& card : cards) card->deliver_until(now_);
  while (!plans_.empty() && plans_.begin()->first <= now_) {
    const auto plan = plans_.begin()->second;
    plans_.erase(plans_.begin());
    plan();
  }
}

void FakeDrm::at(Nanoseconds time, std::function<void()> what) {
  plans_.emplace(time, std::move(what));
}

void FakeDrm::announce_hotplug() {
  const uint64_t one = 1;
  (void)!::write(hotplug_fd_, &one, sizeof(one));
}

}  // namespace lenticule::test
