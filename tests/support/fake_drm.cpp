// SPDX-License-Identifier: Apache-2.0
#include "fake_drm.h"

#include <drm.h>
#include <fcntl.h>
#include <poll.h>
#include <sys/eventfd.h>
#include <sys/socket.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstring>
#include <numeric>

#include "optics/error.h"

namespace lenticule::testing {
namespace {

FakeDrm* the_machine = nullptr;

constexpr uint64_t kMapOffsetUnit = uint64_t{1} << 32;

template <typename Event>
std::vector<uint8_t> bytes_of(const Event& event) {
  const auto* begin = reinterpret_cast<const uint8_t*>(&event);
  return {begin, begin + sizeof(Event)};
}

FakeProperty range(const std::string& name, uint64_t value, uint64_t maximum) {
  return {.name = name, .flags = DRM_MODE_PROP_RANGE, .value = value, .maximum = maximum};
}
FakeProperty blob(const std::string& name, uint32_t extra_flags = 0) {
  return {.name = name, .flags = DRM_MODE_PROP_BLOB | extra_flags};
}
FakeProperty reference(const std::string& name) {
  return {.name = name, .flags = DRM_MODE_PROP_OBJECT};
}

bool readable(int fd) {
  pollfd entry{.fd = fd, .events = POLLIN, .revents = 0};
  return fd >= 0 && poll(&entry, 1, 0) == 1;
}

/// Waiting lets simulated time pass, one happening after the other.
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
  [[nodiscard]] frames::UniqueFd open_device(const std::string& path) override {
    FakeCard* card = machine_.card_at(path);
    if (card == nullptr || card->gone)
      throw Error(ErrorKind::Device, path + ": No such file or directory");
    if (card->forbidden) throw Error(ErrorKind::Device, path + ": Permission denied");
    return frames::UniqueFd(card->open_end());
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

 private:
  FakeDrm& machine_;
};

std::vector<uint8_t> EdidMaker::bytes() const {
  std::vector<uint8_t> block(128, 0);
  std::fill(block.begin() + 1, block.begin() + 7, uint8_t{0xff});
  const auto letter = [&](size_t i) { return static_cast<unsigned>(manufacturer[i] - 'A' + 1); };
  const unsigned packed = letter(0) << 10 | letter(1) << 5 | letter(2);
  block[8] = static_cast<uint8_t>(packed >> 8);
  block[9] = static_cast<uint8_t>(packed);
  block[10] = static_cast<uint8_t>(product);
  block[11] = static_cast<uint8_t>(product >> 8);
  for (size_t i = 0; i < 4; ++i) block[12 + i] = static_cast<uint8_t>(serial_number >> (8 * i));
  block[18] = 1;
  block[19] = 4;
  block[20] = 0xa5;
  block[24] = ycbcr ? 0x1a : 0x02;
  const auto put_text = [&](size_t at, uint8_t tag, const std::string& text) {
    block[at + 3] = tag;
    for (size_t i = 0; i < 13; ++i)
      block[at + 5 + i] = i < text.size()    ? static_cast<uint8_t>(text[i])
                          : i == text.size() ? uint8_t{'\n'}
                                             : uint8_t{' '};
  };
  if (!name.empty()) put_text(72, 0xfc, name);
  if (!serial_text.empty()) put_text(90, 0xff, serial_text);
  block[127] = static_cast<uint8_t>(-std::accumulate(block.begin(), block.end() - 1, 0));
  return block;
}

drmModeModeInfo make_mode(int width, int height, int hertz, bool preferred) {
  drmModeModeInfo mode{};
  mode.hdisplay = static_cast<uint16_t>(width);
  mode.hsync_start = static_cast<uint16_t>(width + 8);
  mode.hsync_end = static_cast<uint16_t>(width + 16);
  mode.htotal = static_cast<uint16_t>(width + 80);
  mode.vdisplay = static_cast<uint16_t>(height);
  mode.vsync_start = static_cast<uint16_t>(height + 2);
  mode.vsync_end = static_cast<uint16_t>(height + 4);
  mode.vtotal = static_cast<uint16_t>(height + 20);
  mode.clock = static_cast<uint32_t>(mode.htotal * mode.vtotal * hertz / 1000);
  mode.vrefresh = static_cast<uint32_t>(hertz);
  mode.type = preferred ? DRM_MODE_TYPE_PREFERRED | DRM_MODE_TYPE_DRIVER : DRM_MODE_TYPE_DRIVER;
  return mode;
}

FakeProperty* FakeObject::find(const std::string& name) {
  for (FakeProperty& property : properties)
    if (property.name == name) return &property;
  return nullptr;
}

uint64_t FakeObject::value(const std::string& name) {
  const FakeProperty* property = find(name);
  LENTICULE_CHECK(property != nullptr);
  return property->value;
}

FakeCard::FakeCard(std::string node_path, std::string driver_name)
    : path(std::move(node_path)), driver(std::move(driver_name)) {}

FakeCard::~FakeCard() {
  for (const auto& [theirs, ours] : ends) ::close(ours);
}

FakeProperty& FakeCard::add_property(uint32_t object, FakeProperty property) {
  property.id = next_id++;
  auto& properties = objects.at(object).properties;
  properties.push_back(std::move(property));
  return properties.back();
}

uint32_t FakeCard::add_blob(std::vector<uint8_t> bytes) {
  const uint32_t id = next_id++;
  blobs[id] = std::move(bytes);
  return id;
}

FakeConnector& FakeCard::add_connector(uint32_t type, uint32_t type_id, drmModeModeInfo mode,
                                       const std::vector<uint8_t>& edid) {
  auto connector = std::make_unique<FakeConnector>();
  connector->id = next_id++;
  connector->type = type;
  connector->type_id = type_id;
  connector->modes = {mode};
  const uint32_t id = connector->id;
  objects[id] = {.id = id, .type = DRM_MODE_OBJECT_CONNECTOR};
  add_property(id, reference("CRTC_ID"));
  add_property(id, blob("EDID", DRM_MODE_PROP_IMMUTABLE));
  add_property(id, range("non-desktop", 0, 1)).flags |= DRM_MODE_PROP_IMMUTABLE;
  add_property(id, {.name = "link-status",
                    .flags = DRM_MODE_PROP_ENUM,
                    .enums = {{"Good", 0}, {"Bad", 1}},
                    .needs_modeset = true});
  connectors.push_back(std::move(connector));
  set_edid(id, edid);
  return *connectors.back();
}

void FakeCard::set_edid(uint32_t connector, const std::vector<uint8_t>& bytes) {
  objects.at(connector).find("EDID")->value = bytes.empty() ? 0 : add_blob(bytes);
}

uint32_t FakeCard::add_crtc() {
  const uint32_t crtc = next_id++;
  objects[crtc] = {.id = crtc, .type = DRM_MODE_OBJECT_CRTC};
  add_property(crtc, range("ACTIVE", 0, 1)).needs_modeset = true;
  add_property(crtc, blob("MODE_ID")).needs_modeset = true;
  for (const char* name : {"GAMMA_LUT", "DEGAMMA_LUT", "CTM"}) add_property(crtc, blob(name));
  const uint32_t plane = next_id++;
  objects[plane] = {.id = plane, .type = DRM_MODE_OBJECT_PLANE};
  add_property(plane, {.name = "type",
                       .flags = DRM_MODE_PROP_ENUM | DRM_MODE_PROP_IMMUTABLE,
                       .value = DRM_PLANE_TYPE_PRIMARY,
                       .enums = {{"Overlay", 0}, {"Primary", 1}, {"Cursor", 2}}});
  add_property(plane, reference("FB_ID"));
  add_property(plane, reference("CRTC_ID"));
  for (const char* name :
       {"SRC_X", "SRC_Y", "SRC_W", "SRC_H", "CRTC_X", "CRTC_Y", "CRTC_W", "CRTC_H"})
    add_property(plane, range(name, 0, UINT32_MAX));
  crtcs.push_back(crtc);
  planes.push_back(plane);
  primary_planes[crtc] = plane;
  possible_crtcs[plane] = 1U << (crtcs.size() - 1);
  return crtc;
}

uint32_t FakeCard::add_overlay_plane(uint32_t crtc) {
  const uint32_t plane = next_id++;
  objects[plane] = {.id = plane, .type = DRM_MODE_OBJECT_PLANE};
  add_property(plane, {.name = "type",
                       .flags = DRM_MODE_PROP_ENUM | DRM_MODE_PROP_IMMUTABLE,
                       .value = DRM_PLANE_TYPE_OVERLAY,
                       .enums = {{"Overlay", 0}, {"Primary", 1}, {"Cursor", 2}}});
  add_property(plane, reference("FB_ID")).value = 1;
  add_property(plane, reference("CRTC_ID")).value = crtc;
  planes.insert(planes.begin(), plane);
  possible_crtcs[plane] = ~0U;
  return plane;
}

void FakeCard::show_console(uint32_t connector, uint32_t crtc) {
  const FakeConnector& shown = **std::find_if(connectors.begin(), connectors.end(),
                                              [&](const auto& c) { return c->id == connector; });
  const drmModeModeInfo& mode = shown.modes.front();
  objects.at(connector).find("CRTC_ID")->value = crtc;
  objects.at(crtc).find("ACTIVE")->value = 1;
  const auto* bytes = reinterpret_cast<const uint8_t*>(&mode);
  objects.at(crtc).find("MODE_ID")->value = add_blob({bytes, bytes + sizeof(mode)});
  const uint32_t handle = next_id++;
  buffers[handle] = {.width = mode.hdisplay, .height = mode.vdisplay, .pitch = mode.hdisplay * 4U};
  buffers[handle].bytes.assign(size_t{mode.hdisplay} * mode.vdisplay * 4, 0x11);
  const uint32_t framebuffer = next_id++;
  framebuffers[framebuffer] = {handle, mode.hdisplay, mode.vdisplay};
  FakeObject& plane = objects.at(primary_of(crtc));
  plane.find("FB_ID")->value = framebuffer;
  plane.find("CRTC_ID")->value = crtc;
  plane.find("SRC_W")->value = uint64_t{mode.hdisplay} << 16;
  plane.find("SRC_H")->value = uint64_t{mode.vdisplay} << 16;
  plane.find("CRTC_W")->value = mode.hdisplay;
  plane.find("CRTC_H")->value = mode.vdisplay;
}

std::vector<uint32_t> FakeCard::glass(uint32_t crtc) {
  FakeObject& plane = objects.at(primary_of(crtc));
  const auto framebuffer = framebuffers.find(static_cast<uint32_t>(plane.value("FB_ID")));
  if (framebuffer == framebuffers.end() || value(crtc, "ACTIVE") == 0) return {};
  const FakeBuffer& buffer = buffers.at(framebuffer->second.handle);
  std::vector<uint32_t> words;
  for (uint32_t j = 0; j < buffer.height; ++j)
    for (uint32_t i = 0; i < buffer.width; ++i) {
      uint32_t word = 0;
      std::memcpy(&word, &buffer.bytes[size_t{j} * buffer.pitch + size_t{i} * 4], sizeof(word));
      words.push_back(word & 0xffffff);
    }
  return words;
}

int FakeCard::fail_with(std::vector<CallFault>& faults) {
  for (CallFault& fault : faults) {
    if (fault.until) {
      if (FakeDrm::instance().now() < *fault.until) return fault.error;
      continue;
    }
    if (fault.skip > 0) {
      --fault.skip;
    } else if (fault.count > 0) {
      --fault.count;
      return fault.error;
    }
  }
  return 0;
}

Nanoseconds FakeCard::next_vblank() const {
  const Nanoseconds now = FakeDrm::instance().now();
  return Nanoseconds((now.count() / period.count() + 1) * period.count());
}

uint64_t FakeCard::sequence_at(Nanoseconds time) const {
  return sequence_base + static_cast<uint64_t>(time.count() / period.count());
}

void FakeCard::schedule_flip_event(uint32_t crtc, uint64_t id) {
  const Nanoseconds now = FakeDrm::instance().now();
  // Without vblanks a flip is done as soon as the driver is.
  const Nanoseconds at = counts_vblanks ? next_vblank() : now + std::chrono::milliseconds(1);
  busy_until = at;
  EventFault fault = EventFault::None;
  if (!event_faults.empty()) {
    fault = event_faults.front();
    event_faults.pop_front();
  }
  if (fault == EventFault::Lose) return;
  drm_event_vblank event{};
  event.base = {.type = DRM_EVENT_FLIP_COMPLETE, .length = sizeof(event)};
  event.user_data = fault == EventFault::Stale ? id - 1 : id;
  event.tv_sec = static_cast<uint32_t>(at.count() / 1'000'000'000);
  event.tv_usec = static_cast<uint32_t>(at.count() / 1000 % 1'000'000);
  event.sequence = counts_vblanks ? static_cast<uint32_t>(sequence_at(at)) : 0;
  event.crtc_id = crtc;
  const Nanoseconds late = fault == EventFault::Late ? 3 * period : Nanoseconds{0};
  pending.push_back({at + late, bytes_of(event)});
  if (fault == EventFault::Duplicate) pending.push_back({at + late, bytes_of(event)});
  if (fault == EventFault::Stale) {
    event.user_data = id;
    pending.push_back({at, bytes_of(event)});
  }
}

void FakeCard::send_sequence(uint64_t sequence, uint64_t id) {
  const Nanoseconds at = std::max(
      Nanoseconds(static_cast<int64_t>(sequence - sequence_base) * period.count()), next_vblank());
  drm_event_crtc_sequence event{};
  event.base = {.type = DRM_EVENT_CRTC_SEQUENCE, .length = sizeof(event)};
  event.user_data = id;
  event.time_ns = at.count();
  event.sequence = sequence_at(at);
  pending.push_back({at, bytes_of(event)});
}

std::optional<Nanoseconds> FakeCard::next_event() const {
  const auto first = std::min_element(pending.begin(), pending.end(),
                                      [](const auto& a, const auto& b) { return a.at < b.at; });
  if (first == pending.end()) return std::nullopt;
  return first->at;
}

void FakeCard::deliver_until(Nanoseconds time) {
  std::stable_sort(pending.begin(), pending.end(),
                   [](const auto& a, const auto& b) { return a.at < b.at; });
  while (!pending.empty() && pending.front().at <= time) {
    for (const auto& [theirs, ours] : ends)
      if (theirs == master_fd)
        (void)!::write(ours, pending.front().bytes.data(), pending.front().bytes.size());
    pending.erase(pending.begin());
  }
}

int FakeCard::open_end() {
  int pair[2] = {-1, -1};
  LENTICULE_CHECK(socketpair(AF_UNIX, SOCK_STREAM | SOCK_NONBLOCK | SOCK_CLOEXEC, 0, pair) == 0);
  ends[pair[0]] = pair[1];
  if (master_fd < 0 && !foreign_master) master_fd = pair[0];
  return pair[0];
}

bool FakeCard::owns(int fd) const {
  return ends.count(fd) != 0;
}

void FakeCard::closed(int fd) {
  if (master_fd == fd) master_fd = -1;
  if (const auto found = ends.find(fd); found != ends.end()) {
    ::close(found->second);
    ends.erase(found);
  }
}

void FakeCard::unplug() {
  gone = true;
  for (const auto& [theirs, ours] : ends) shutdown(ours, SHUT_RDWR);
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

std::shared_ptr<display::Clock> FakeDrm::clock() {
  return std::make_shared<FakeClock>(*this);
}
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

}  // namespace lenticule::testing
