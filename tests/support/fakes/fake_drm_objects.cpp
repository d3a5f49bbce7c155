// SPDX-License-Identifier: Apache-2.0
// Implements libdrm's query functions: the cards and their objects.
#include <drm_fourcc.h>
#include <xf86drm.h>
#include <xf86drmMode.h>

#include <cstring>

#include "fake_drm_internal.h"

using namespace lenticule::test;

namespace {

const FakeConnector* connector_of(const FakeCard& card, uint32_t id) {
  for (const auto& connector : card.connectors)
    if (connector->id == id) return connector.get();
  return nullptr;
}

drmModeConnectorPtr get_connector(int fd, uint32_t id) {
  FakeCard* card = card_of(fd);
  if (begin_call(card, &FakeCard::get_connector_faults) != 0) return nullptr;
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

}  // namespace

extern "C" {

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

int drmIsKMS(int fd) { return card_of(fd) != nullptr ? 1 : 0; }

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
  FakeCard* card = card_of(fd);
  if (card == nullptr) return -ENODEV;
  if (capability == 7) {  // DRM_CLIENT_CAP_PLANE_COLOR_PIPELINE
    card->shows_color_pipelines = value == 1;
    return 0;
  }
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
    case DRM_MODE_CONNECTOR_eDP:
      return "eDP";
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
  if (const auto ramp = card->ramps.find(id); ramp != card->ramps.end())
    crtc->gamma_size = static_cast<int>(ramp->second.red.size());
  const auto mode = card->blobs.find(static_cast<uint32_t>(card->value(id, "MODE_ID")));
  if (mode != card->blobs.end() && mode->second.size() == sizeof(crtc->mode)) {
    std::memcpy(&crtc->mode, mode->second.data(), sizeof(crtc->mode));
    crtc->mode_valid = 1;
  }
  return crtc;
}
int drmModeCrtcGetGamma(int fd, uint32_t crtc, uint32_t size, uint16_t* red, uint16_t* green,
                        uint16_t* blue) {
  FakeCard* card = card_of(fd);
  if (const int error = begin_call(card, &FakeCard::get_gamma_faults); error != 0) return error;
  const auto ramp = card->ramps.find(crtc);
  if (ramp == card->ramps.end() || ramp->second.red.size() != size) return -EINVAL;
  std::copy(ramp->second.red.begin(), ramp->second.red.end(), red);
  std::copy(ramp->second.green.begin(), ramp->second.green.end(), green);
  std::copy(ramp->second.blue.begin(), ramp->second.blue.end(), blue);
  return 0;
}
void drmModeFreeCrtc(drmModeCrtcPtr crtc) { std::free(crtc); }

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
  plane->count_formats = static_cast<uint32_t>(card->formats.size());
  plane->formats = copied(card->formats);
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
  list->props = zeroed<uint32_t>(object.properties.size());
  list->prop_values = zeroed<uint64_t>(object.properties.size());
  for (const FakeProperty& property : object.properties) {
    if (property.name == "COLOR_PIPELINE" && !card->shows_color_pipelines) continue;
    list->props[list->count_props] = property.id;
    list->prop_values[list->count_props++] = property.value;
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

}  // extern "C"
