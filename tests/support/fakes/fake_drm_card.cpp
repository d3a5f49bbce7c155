// SPDX-License-Identifier: Apache-2.0
// Implements one fake card: its objects, the requests that its driver accepts and refuses, and its
// events.
#include <drm.h>
#include <sys/socket.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstring>
#include <numeric>
#include <set>

#include "base/error.h"
#include "fake_drm.h"

namespace lenticule::test {
namespace {

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

FakeProperty* property_of(FakeCard& card, uint32_t object, uint32_t id) {
  const auto found = card.objects.find(object);
  if (found == card.objects.end()) return nullptr;
  for (FakeProperty& property : found->second.properties)
    if (property.id == id) return &property;
  return nullptr;
}

/// Returns the error of the checks that every driver makes before it accepts a request; 0 if all
/// pass.
int check_setting(FakeCard& card, FakeProperty* property, uint64_t value, bool may_modeset) {
  if (property == nullptr) return -ENOENT;
  if ((property->flags & DRM_MODE_PROP_IMMUTABLE) != 0) return -EINVAL;
  if (property->refuses == value) return -EINVAL;
  if (property->maximum > 0 && (value < property->minimum || value > property->maximum))
    return -EINVAL;
  const bool is_blob = (property->flags & DRM_MODE_PROP_BLOB) != 0;
  if (is_blob && value != 0 && card.blobs.count(static_cast<uint32_t>(value)) == 0) return -EINVAL;
  bool changes = property->value != value;
  if (is_blob && changes && property->value != 0 && value != 0)
    changes = card.blobs[static_cast<uint32_t>(property->value)] !=
              card.blobs[static_cast<uint32_t>(value)];
  if (property->name == "CRTC_ID" && property->flags == DRM_MODE_PROP_OBJECT && changes &&
      !may_modeset && property->value != 0)
    return -EINVAL;
  return changes && property->needs_modeset && !may_modeset ? -EINVAL : 0;
}

}  // namespace

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
  block[20] = static_cast<uint8_t>(0x85 | (bits - 4) / 2 << 4);
  block[24] = ycbcr ? 0x1a : 0x02;
  if (width > 0) {
    block[54] = block[55] = 1;
    block[56] = static_cast<uint8_t>(width);
    block[58] = static_cast<uint8_t>(width >> 8 << 4);
    block[59] = static_cast<uint8_t>(height);
    block[61] = static_cast<uint8_t>(height >> 8 << 4);
    block[71] = interlaced ? 0x80 : 0;
  }
  const auto put_text = [&](size_t at, uint8_t tag, const std::string& text) {
    block[at + 3] = tag;
    for (size_t i = 0; i < 13; ++i)
      block[at + 5 + i] = i < text.size()    ? static_cast<uint8_t>(text[i])
                          : i == text.size() ? uint8_t{'\n'}
                                             : uint8_t{' '};
  };
  if (!name.empty()) put_text(72, 0xfc, name);
  if (!serial_text.empty()) put_text(90, 0xff, serial_text);
  if (deep_colour) block[126] = 1;
  block[127] = static_cast<uint8_t>(-std::accumulate(block.begin(), block.end() - 1, 0));
  if (deep_colour) {
    const uint8_t extension[] = {2, 3, 12, 0, 0x67, 0x03, 0x0c, 0x00, 0x10, 0x00, 0x10, 0x00};
    block.insert(block.end(), std::begin(extension), std::end(extension));
    block.resize(256, 0);
    block[255] = static_cast<uint8_t>(-std::accumulate(block.begin() + 128, block.end(), 0));
  }
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

FakeRamp& FakeCard::use_legacy_gamma(uint32_t crtc, size_t entries) {
  std::erase_if(objects.at(crtc).properties, [](const FakeProperty& property) {
    return property.name == "GAMMA_LUT" || property.name == "DEGAMMA_LUT";
  });
  std::vector<uint16_t> values(entries);
  for (size_t i = 0; i < entries; ++i) values[i] = static_cast<uint16_t>(i << 8);
  return ramps[crtc] = {values, values, values};
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

std::vector<uint32_t> FakeCard::displayed(uint32_t crtc) {
  FakeObject& plane = objects.at(primary_of(crtc));
  const auto framebuffer = framebuffers.find(static_cast<uint32_t>(plane.value("FB_ID")));
  if (framebuffer == framebuffers.end() || value(crtc, "ACTIVE") == 0) return {};
  const FakeBuffer& buffer = buffers.at(framebuffer->second.handle);
  const auto source = [&plane](const char* name) {
    return static_cast<uint32_t>(plane.value(name) >> 16);
  };
  const uint32_t left = source("SRC_X"), top = source("SRC_Y");
  const uint32_t bits =
      framebuffer->second.format == DRM_FORMAT_XRGB2101010 ? 0x3fffffff : 0xffffff;
  std::vector<uint32_t> words;
  for (uint32_t j = top; j < std::min(buffer.height, top + source("SRC_H")); ++j)
    for (uint32_t i = left; i < std::min(buffer.width, left + source("SRC_W")); ++i) {
      uint32_t word = 0;
      std::memcpy(&word, &buffer.bytes[size_t{j} * buffer.pitch + size_t{i} * 4], sizeof(word));
      words.push_back(word & bits);
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
  // A flip without vblanks completes as soon as the driver can.
  const Nanoseconds at =
      (counts_vblanks ? next_vblank() : now + std::chrono::milliseconds(1)) + crtc_shift[crtc];
  busy_until[crtc] = at;
  EventFault fault = EventFault::None;
  if (!event_faults.empty()) {
    fault = event_faults.front();
    event_faults.pop_front();
  }
  if (fault == EventFault::Lose) return;
  drm_event_vblank event{};
  event.base = {.type = DRM_EVENT_FLIP_COMPLETE, .length = sizeof(event)};
  event.user_data = fault == EventFault::Stale ? id - 1 : id;
  const Nanoseconds said = at + timestamp_shift;
  event.tv_sec = static_cast<uint32_t>(said.count() / 1'000'000'000);
  event.tv_usec = static_cast<uint32_t>(said.count() / 1000 % 1'000'000);
  event.sequence = counts_vblanks ? static_cast<uint32_t>(sequence_at(at)) : 0;
  event.crtc_id = crtc;
  const Nanoseconds late = delay() + (fault == EventFault::Late ? 3 * period : Nanoseconds{0});
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
  event.time_ns = (at + timestamp_shift).count();
  event.sequence = sequence_at(at);
  pending.push_back({at + delay(), bytes_of(event)});
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

bool FakeCard::owns(int fd) const { return ends.count(fd) != 0; }

void FakeCard::closed(int fd) {
  if (master_fd == fd) master_fd = -1;
  if (const auto found = ends.find(fd); found != ends.end()) {
    ::close(found->second);
    ends.erase(found);
  }
  if (gone && ends.empty()) forget_contents();
}

/// Drops the buffers of an unplugged card, which are lost.
void FakeCard::forget_contents() {
  buffers.clear();
  framebuffers.clear();
  for (const uint32_t crtc : crtcs) {
    objects.at(crtc).find("ACTIVE")->value = 0;
    objects.at(primary_of(crtc)).find("FB_ID")->value = 0;
  }
}

void FakeCard::unplug() {
  gone = true;
  for (const auto& [theirs, ours] : ends) shutdown(ours, SHUT_RDWR);
}

std::set<uint32_t> FakeCard::crtcs_flipped_by(
    const std::vector<std::array<uint64_t, 3>>& settings) {
  std::set<uint32_t> flipped;
  for (const auto& [object, id, value] : settings) {
    const auto plane = static_cast<uint32_t>(object);
    if (property_of(*this, plane, static_cast<uint32_t>(id))->name == "FB_ID")
      flipped.insert(static_cast<uint32_t>(objects.at(plane).value("CRTC_ID")));
  }
  return flipped;
}

int FakeCard::commit(const std::vector<std::array<uint64_t, 3>>& settings, uint32_t flags,
                     uint64_t user_data) {
  const bool test = (flags & DRM_MODE_ATOMIC_TEST_ONLY) != 0;
  const bool nonblock = (flags & DRM_MODE_ATOMIC_NONBLOCK) != 0;
  const bool may_modeset = (flags & DRM_MODE_ATOMIC_ALLOW_MODESET) != 0;
  if (test && (flags & DRM_MODE_PAGE_FLIP_EVENT) != 0) return -EINVAL;
  if (foreign_master) return -EACCES;
  if (const int error = fail_with(test       ? test_faults
                                  : nonblock ? flip_faults
                                             : commit_faults);
      error != 0)
    return -error;
  for (const auto& [object, id, value] : settings) {
    const int error = check_setting(
        *this, property_of(*this, static_cast<uint32_t>(object), static_cast<uint32_t>(id)), value,
        may_modeset);
    if (error != 0) return error;
  }
  if (test) {
    ++tests;
    return 0;
  }
  const std::set<uint32_t> flipped = crtcs_flipped_by(settings);
  const auto is_busy = [this](uint32_t crtc) {
    return busy_until[crtc] > FakeDrm::instance().now();
  };
  if (nonblock && !joint_flips && flipped.size() > 1) return -EINVAL;
  if (nonblock && std::ranges::any_of(flipped, is_busy)) return -EBUSY;
  for (const auto& [object, id, value] : settings) {
    FakeProperty& property =
        *property_of(*this, static_cast<uint32_t>(object), static_cast<uint32_t>(id));
    if (!property.ignores_writes) property.value = value;
  }
  if (nonblock) {
    ++flips;
    last_flip_id = user_data;
    for (const uint32_t crtc : flipped) schedule_flip_event(crtc, user_data);
    const auto shown = static_cast<uint32_t>(value(primary_of(*flipped.begin()), "FB_ID"));
    if (on_flip) on_flip(sequence_at(next_vblank()), buffers.at(framebuffers.at(shown).handle));
  } else {
    ++(may_modeset ? modesets : blocking_commits);
  }
  return 0;
}

}  // namespace lenticule::test
