// SPDX-License-Identifier: Apache-2.0
// libdrm's functions, answered by the fake cards. Every one that display/kms calls is here.
#include <drm.h>
#include <drm_fourcc.h>
#include <xf86drm.h>
#include <xf86drmMode.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstdlib>
#include <cstring>

#include "fake_drm.h"

using lenticule::testing::FakeCard;
using lenticule::testing::FakeConnector;
using lenticule::testing::FakeDrm;
using lenticule::testing::FakeObject;
using lenticule::testing::FakeProperty;

namespace lenticule::testing {
namespace {

FakeCard* card_of(int fd) {
  FakeCard* card = FakeDrm::instance().card_of(fd);
  return card != nullptr && !card->gone ? card : nullptr;
}

template <typename T>
T* zeroed(size_t count = 1) {
  return static_cast<T*>(std::calloc(std::max<size_t>(count, 1), sizeof(T)));
}

template <typename T>
T* copied(const std::vector<T>& values) {
  T* const copy = zeroed<T>(values.size());
  std::copy(values.begin(), values.end(), copy);
  return copy;
}

FakeConnector* connector_of(FakeCard& card, uint32_t id) {
  for (const auto& connector : card.connectors)
    if (connector->id == id) return connector.get();
  return nullptr;
}

FakeProperty* property_of(FakeCard& card, uint32_t object, uint32_t id) {
  const auto found = card.objects.find(object);
  if (found == card.objects.end()) return nullptr;
  for (FakeProperty& property : found->second.properties)
    if (property.id == id) return &property;
  return nullptr;
}

/// What any driver checks before it takes a request.
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
  if (nonblock && busy_until > FakeDrm::instance().now()) return -EBUSY;
  uint32_t crtc = 0;
  for (const auto& [object, id, value] : settings) {
    FakeProperty& property =
        *property_of(*this, static_cast<uint32_t>(object), static_cast<uint32_t>(id));
    if (!property.ignores_writes) property.value = value;
    if (property.name == "FB_ID")
      crtc = static_cast<uint32_t>(objects.at(static_cast<uint32_t>(object)).value("CRTC_ID"));
  }
  if (nonblock) {
    ++flips;
    last_flip_id = user_data;
    schedule_flip_event(crtc, user_data);
  } else {
    ++(may_modeset ? modesets : blocking_commits);
  }
  return 0;
}

}  // namespace lenticule::testing

using namespace lenticule::testing;

extern "C" {

struct _drmModeAtomicReq {
  std::vector<std::array<uint64_t, 3>> settings;
};

int drmGetDevices2(uint32_t flags, drmDevicePtr devices[], int max_devices) {
  (void)flags;
  int count = 0;
  for (const auto& card : FakeDrm::instance().cards) {
    if (card->gone || count == max_devices) continue;
    auto* const device = zeroed<drmDevice>();
    device->nodes = zeroed<char*>(DRM_NODE_MAX);
    device->nodes[DRM_NODE_PRIMARY] = strdup(card->path.c_str());
    device->available_nodes = 1 << DRM_NODE_PRIMARY;
    device->bustype = DRM_BUS_PLATFORM;
    devices[count++] = device;
  }
  return count;
}

void drmFreeDevices(drmDevicePtr devices[], int count) {
  for (int i = 0; i < count; ++i) {
    std::free(devices[i]->nodes[DRM_NODE_PRIMARY]);
    std::free(devices[i]->nodes);
    std::free(devices[i]);
  }
}

int drmIsKMS(int fd) {
  return card_of(fd) != nullptr ? 1 : 0;
}

drmVersionPtr drmGetVersion(int fd) {
  FakeCard* card = card_of(fd);
  if (card == nullptr) return nullptr;
  auto* const version = zeroed<drmVersion>();
  version->name = strdup(card->driver.c_str());
  version->name_len = static_cast<int>(card->driver.size());
  return version;
}
void drmFreeVersion(drmVersionPtr version) {
  std::free(version->name);
  std::free(version);
}

int drmSetClientCap(int fd, uint64_t capability, uint64_t value) {
  (void)value;
  FakeCard* card = card_of(fd);
  if (card == nullptr) return -ENODEV;
  return capability == DRM_CLIENT_CAP_ATOMIC && !card->atomic ? -EOPNOTSUPP : 0;
}

int drmGetCap(int fd, uint64_t capability, uint64_t* value) {
  if (card_of(fd) == nullptr) return -ENODEV;
  *value = capability == DRM_CAP_DUMB_BUFFER || capability == DRM_CAP_TIMESTAMP_MONOTONIC ||
                   capability == DRM_CAP_CRTC_IN_VBLANK_EVENT
               ? 1
               : 0;
  return 0;
}

int drmIsMaster(int fd) {
  FakeCard* card = card_of(fd);
  return card != nullptr && card->master_fd == fd ? 1 : 0;
}
int drmSetMaster(int fd) {
  FakeCard* card = card_of(fd);
  if (card == nullptr || card->foreign_master) {
    errno = EBUSY;
    return -1;
  }
  card->master_fd = fd;
  return 0;
}
int drmDropMaster(int fd) {
  if (FakeCard* card = card_of(fd); card != nullptr && card->master_fd == fd) card->master_fd = -1;
  return 0;
}

drmModeResPtr drmModeGetResources(int fd) {
  FakeCard* card = card_of(fd);
  if (card == nullptr) return nullptr;
  auto* const resources = zeroed<drmModeRes>();
  resources->count_crtcs = static_cast<int>(card->crtcs.size());
  resources->crtcs = copied(card->crtcs);
  std::vector<uint32_t> ids;
  for (const auto& connector : card->connectors) ids.push_back(connector->id);
  resources->count_connectors = static_cast<int>(ids.size());
  resources->connectors = copied(ids);
  return resources;
}
void drmModeFreeResources(drmModeResPtr resources) {
  std::free(resources->crtcs);
  std::free(resources->connectors);
  std::free(resources);
}

static drmModeConnectorPtr get_connector(int fd, uint32_t id) {
  FakeCard* card = card_of(fd);
  if (card == nullptr || card->fail_with(card->get_connector_faults) != 0) return nullptr;
  const FakeConnector* source = connector_of(*card, id);
  if (source == nullptr) return nullptr;
  auto* const connector = zeroed<drmModeConnector>();
  connector->connector_id = id;
  connector->connector_type = source->type;
  connector->connector_type_id = source->type_id;
  connector->connection = source->connected ? DRM_MODE_CONNECTED : DRM_MODE_DISCONNECTED;
  connector->mmWidth = 600;
  connector->mmHeight = 340;
  connector->count_modes = source->connected ? static_cast<int>(source->modes.size()) : 0;
  connector->modes = copied(source->modes);
  return connector;
}
drmModeConnectorPtr drmModeGetConnector(int fd, uint32_t id) {
  if (FakeCard* card = card_of(fd)) ++card->full_probes;
  return get_connector(fd, id);
}
drmModeConnectorPtr drmModeGetConnectorCurrent(int fd, uint32_t id) {
  return get_connector(fd, id);
}
void drmModeFreeConnector(drmModeConnectorPtr connector) {
  std::free(connector->modes);
  std::free(connector);
}
uint32_t drmModeConnectorGetPossibleCrtcs(int fd, const drmModeConnector* connector) {
  FakeCard* card = card_of(fd);
  return card == nullptr ? 0 : connector_of(*card, connector->connector_id)->possible_crtcs;
}
const char* drmModeGetConnectorTypeName(uint32_t type) {
  switch (type) {
    case DRM_MODE_CONNECTOR_HDMIA:
      return "HDMI-A";
    case DRM_MODE_CONNECTOR_DisplayPort:
      return "DP";
    case DRM_MODE_CONNECTOR_VIRTUAL:
      return "Virtual";
    default:
      return nullptr;
  }
}

drmModeCrtcPtr drmModeGetCrtc(int fd, uint32_t id) {
  FakeCard* card = card_of(fd);
  if (card == nullptr || card->objects.count(id) == 0) return nullptr;
  auto* const crtc = zeroed<drmModeCrtc>();
  crtc->crtc_id = id;
  const auto mode = card->blobs.find(static_cast<uint32_t>(card->value(id, "MODE_ID")));
  if (mode != card->blobs.end() && mode->second.size() == sizeof(crtc->mode)) {
    std::memcpy(&crtc->mode, mode->second.data(), sizeof(crtc->mode));
    crtc->mode_valid = 1;
  }
  return crtc;
}
void drmModeFreeCrtc(drmModeCrtcPtr crtc) {
  std::free(crtc);
}

drmModePlaneResPtr drmModeGetPlaneResources(int fd) {
  FakeCard* card = card_of(fd);
  if (card == nullptr) return nullptr;
  auto* const planes = zeroed<drmModePlaneRes>();
  planes->count_planes = static_cast<uint32_t>(card->planes.size());
  planes->planes = copied(card->planes);
  return planes;
}
void drmModeFreePlaneResources(drmModePlaneResPtr planes) {
  std::free(planes->planes);
  std::free(planes);
}
drmModePlanePtr drmModeGetPlane(int fd, uint32_t id) {
  FakeCard* card = card_of(fd);
  if (card == nullptr || card->objects.count(id) == 0) return nullptr;
  auto* const plane = zeroed<drmModePlane>();
  plane->plane_id = id;
  plane->count_formats = 1;
  plane->formats = copied(std::vector<uint32_t>{DRM_FORMAT_XRGB8888});
  plane->crtc_id = static_cast<uint32_t>(card->value(id, "CRTC_ID"));
  plane->fb_id = static_cast<uint32_t>(card->value(id, "FB_ID"));
  plane->possible_crtcs = card->possible_crtcs.at(id);
  return plane;
}
void drmModeFreePlane(drmModePlanePtr plane) {
  std::free(plane->formats);
  std::free(plane);
}

drmModeObjectPropertiesPtr drmModeObjectGetProperties(int fd, uint32_t id, uint32_t type) {
  (void)type;
  FakeCard* card = card_of(fd);
  if (card == nullptr || card->objects.count(id) == 0) return nullptr;
  const FakeObject& object = card->objects.at(id);
  auto* const list = zeroed<drmModeObjectProperties>();
  list->count_props = static_cast<uint32_t>(object.properties.size());
  list->props = zeroed<uint32_t>(object.properties.size());
  list->prop_values = zeroed<uint64_t>(object.properties.size());
  for (size_t i = 0; i < object.properties.size(); ++i) {
    list->props[i] = object.properties[i].id;
    list->prop_values[i] = object.properties[i].value;
  }
  return list;
}
void drmModeFreeObjectProperties(drmModeObjectPropertiesPtr list) {
  std::free(list->props);
  std::free(list->prop_values);
  std::free(list);
}

drmModePropertyPtr drmModeGetProperty(int fd, uint32_t id) {
  FakeCard* card = card_of(fd);
  if (card == nullptr) return nullptr;
  for (const auto& [object, contents] : card->objects)
    for (const FakeProperty& source : contents.properties) {
      if (source.id != id) continue;
      auto* const property = zeroed<drmModePropertyRes>();
      property->prop_id = id;
      property->flags = source.flags;
      std::strncpy(property->name, source.name.c_str(), DRM_PROP_NAME_LEN - 1);
      property->count_values = 2;
      property->values = copied(std::vector<uint64_t>{source.minimum, source.maximum});
      property->count_enums = static_cast<int>(source.enums.size());
      property->enums = zeroed<drm_mode_property_enum>(source.enums.size());
      for (size_t i = 0; i < source.enums.size(); ++i) {
        property->enums[i].value = source.enums[i].second;
        std::strncpy(property->enums[i].name, source.enums[i].first.c_str(), DRM_PROP_NAME_LEN - 1);
      }
      return property;
    }
  return nullptr;
}
void drmModeFreeProperty(drmModePropertyPtr property) {
  std::free(property->values);
  std::free(property->enums);
  std::free(property);
}

drmModePropertyBlobPtr drmModeGetPropertyBlob(int fd, uint32_t id) {
  FakeCard* card = card_of(fd);
  if (card == nullptr || card->blobs.count(id) == 0) return nullptr;
  auto* const blob = zeroed<drmModePropertyBlobRes>();
  blob->id = id;
  blob->length = static_cast<uint32_t>(card->blobs[id].size());
  blob->data = copied(card->blobs[id]);
  return blob;
}
void drmModeFreePropertyBlob(drmModePropertyBlobPtr blob) {
  std::free(blob->data);
  std::free(blob);
}
int drmModeCreatePropertyBlob(int fd, const void* data, size_t size, uint32_t* id) {
  FakeCard* card = card_of(fd);
  if (card == nullptr) return -ENODEV;
  const auto* bytes = static_cast<const uint8_t*>(data);
  *id = card->add_blob({bytes, bytes + size});
  return 0;
}
int drmModeDestroyPropertyBlob(int fd, uint32_t id) {
  (void)fd;  // the state keeps its own reference
  (void)id;
  return 0;
}

drmModeAtomicReqPtr drmModeAtomicAlloc(void) {
  return new _drmModeAtomicReq;
}
void drmModeAtomicFree(drmModeAtomicReqPtr request) {
  delete request;
}
void drmModeAtomicSetCursor(drmModeAtomicReqPtr request, int cursor) {
  request->settings.resize(static_cast<size_t>(cursor));
}
int drmModeAtomicAddProperty(drmModeAtomicReqPtr request, uint32_t object, uint32_t property,
                             uint64_t value) {
  request->settings.push_back({object, property, value});
  return static_cast<int>(request->settings.size());
}
int drmModeAtomicCommit(int fd, const drmModeAtomicReqPtr request, uint32_t flags,
                        void* user_data) {
  FakeCard* card = card_of(fd);
  if (card == nullptr) return -ENODEV;
  if (card->master_fd != fd) return -EACCES;
  return card->commit(request->settings, flags, reinterpret_cast<uintptr_t>(user_data));
}

int drmModeCreateDumbBuffer(int fd, uint32_t width, uint32_t height, uint32_t bpp, uint32_t flags,
                            uint32_t* handle, uint32_t* pitch, uint64_t* size) {
  (void)bpp;
  (void)flags;
  FakeCard* card = card_of(fd);
  if (card == nullptr) return -ENODEV;
  if (const int error = card->fail_with(card->create_faults); error != 0) return -error;
  if (card->buffers.size() >= card->max_buffers) return -ENOMEM;
  *handle = card->next_id++;
  *pitch = (width * 4 + 63) / 64 * 64;
  *size = uint64_t{*pitch} * height;
  card->buffers[*handle] = {.width = width, .height = height, .pitch = *pitch};
  card->buffers[*handle].bytes.assign(*size, 0xcd);  // somebody's old picture
  return 0;
}
int drmModeDestroyDumbBuffer(int fd, uint32_t handle) {
  FakeCard* card = card_of(fd);
  return card != nullptr && card->buffers.erase(handle) == 1 ? 0 : -ENOENT;
}
int drmModeMapDumbBuffer(int fd, uint32_t handle, uint64_t* offset) {
  FakeCard* card = card_of(fd);
  if (card == nullptr || card->buffers.count(handle) == 0) return -ENOENT;
  if (const int error = card->fail_with(card->map_faults); error != 0) return -error;
  *offset = uint64_t{handle} << 32;
  return 0;
}
int drmModeAddFB2(int fd, uint32_t width, uint32_t height, uint32_t format,
                  const uint32_t handles[4], const uint32_t pitches[4], const uint32_t offsets[4],
                  uint32_t* id, uint32_t flags) {
  (void)pitches;
  (void)offsets;
  (void)flags;
  FakeCard* card = card_of(fd);
  if (card == nullptr) return -ENODEV;
  if (format != DRM_FORMAT_XRGB8888 || card->buffers.count(handles[0]) == 0) return -EINVAL;
  *id = card->next_id++;
  card->framebuffers[*id] = {handles[0], width, height};
  return 0;
}
int drmModeRmFB(int fd, uint32_t id) {
  FakeCard* card = card_of(fd);
  if (card == nullptr) return -ENODEV;
  for (const auto& [crtc, plane] : card->primary_planes)
    if (card->value(plane, "FB_ID") == id && card->value(crtc, "ACTIVE") == 1)
      ++card->rmfb_on_screen;
  return card->framebuffers.erase(id) == 1 ? 0 : -ENOENT;
}

int drmCrtcGetSequence(int fd, uint32_t crtc, uint64_t* sequence, uint64_t* ns) {
  FakeCard* card = card_of(fd);
  if (card == nullptr || !card->counts_vblanks || card->value(crtc, "ACTIVE") == 0) {
    errno = card == nullptr ? ENODEV : EOPNOTSUPP;
    return -1;
  }
  const auto now = FakeDrm::instance().now();
  *sequence = card->sequence_at(now);
  *ns = static_cast<uint64_t>(now.count() / card->period.count() * card->period.count());
  return 0;
}
int drmCrtcQueueSequence(int fd, uint32_t crtc, uint32_t flags, uint64_t sequence, uint64_t* queued,
                         uint64_t user_data) {
  (void)flags;
  FakeCard* card = card_of(fd);
  if (card == nullptr || !card->counts_vblanks || card->value(crtc, "ACTIVE") == 0) {
    errno = card == nullptr ? ENODEV : EOPNOTSUPP;
    return -1;
  }
  *queued = std::max(sequence, card->sequence_at(FakeDrm::instance().now()) + 1);
  card->send_sequence(*queued, user_data);
  return 0;
}

}  // extern "C"
