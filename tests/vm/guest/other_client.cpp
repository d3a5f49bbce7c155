// SPDX-License-Identifier: Apache-2.0
// Runs in the guest as root: leaves on a card what another program may leave there.
//   vm_other_client CARD
// Shows a grey picture on the first CRTC, a second one on an overlay plane above, and lets the
// first pass through the primary plane's colour pipeline. Then gives up the role of DRM master,
// prints "left" and keeps the card open, so that the kernel keeps all that.
#include <fcntl.h>
#include <unistd.h>

#include <algorithm>
#include <cstdio>

#include "drm_card.h"

namespace lenticule::vm {
namespace {

using Planes = std::unique_ptr<drmModePlaneRes, Freed<drmModeFreePlaneResources>>;

// This is new in Linux 6.19, which Debian 12's headers precede.
constexpr uint64_t plane_color_pipeline_cap = 7;
constexpr uint32_t colorop_object = 0xfafafafa;

uint32_t plane_of_type(int fd, uint64_t type) {
  const Planes planes(drmModeGetPlaneResources(fd));
  for (uint32_t i = 0; planes && i < planes->count_planes; ++i)
    if (property(fd, planes->planes[i], DRM_MODE_OBJECT_PLANE, "type").value == type)
      return planes->planes[i];
  throw std::runtime_error("no plane of type " + std::to_string(type));
}

void fill_grey(DumbBuffer& buffer) {
  for (uint32_t y = 0; y < buffer.height(); ++y) std::ranges::fill(buffer.row(y), uint8_t{0x80});
}

void show_on_plane(int fd, drmModeAtomicReq* request, uint32_t plane, uint32_t crtc,
                   const DumbBuffer& buffer) {
  const auto add = [&](const char* name, uint64_t value) {
    assign(fd, request, plane, DRM_MODE_OBJECT_PLANE, name, value);
  };
  add("FB_ID", buffer.framebuffer());
  add("CRTC_ID", crtc);
  for (const char* zero : {"SRC_X", "SRC_Y", "CRTC_X", "CRTC_Y"}) add(zero, 0);
  add("SRC_W", uint64_t{buffer.width()} << 16);
  add("SRC_H", uint64_t{buffer.height()} << 16);
  add("CRTC_W", buffer.width());
  add("CRTC_H", buffer.height());
}

// Selects the plane's first pipeline, and lets its first operation take effect.
void use_color_pipeline(int fd, drmModeAtomicReq* request, uint32_t plane) {
  const NamedProperty pipeline = property(fd, plane, DRM_MODE_OBJECT_PLANE, "COLOR_PIPELINE");
  const Property listed(drmModeGetProperty(fd, pipeline.id));
  if (!listed || listed->count_enums < 2) throw std::runtime_error("no colour pipeline");
  const uint64_t first = listed->enums[1].value;  // the enumerator before it is "Bypass"
  assign(fd, request, plane, DRM_MODE_OBJECT_PLANE, "COLOR_PIPELINE", first);
  assign(fd, request, static_cast<uint32_t>(first), colorop_object, "BYPASS", 0);
}

void leave_state(const char* path) {
  const Descriptor card(checked(open(path, O_RDWR | O_CLOEXEC), path));
  const int fd = card.get();
  checked(drmSetClientCap(fd, DRM_CLIENT_CAP_ATOMIC, 1), "atomic modesetting");
  checked(drmSetClientCap(fd, plane_color_pipeline_cap, 1), "plane colour pipelines");
  const Resources resources(drmModeGetResources(fd));
  if (!resources || resources->count_connectors == 0) throw std::runtime_error("no connector");
  const Connector connector(drmModeGetConnector(fd, resources->connectors[0]));
  if (!connector || connector->count_modes == 0) throw std::runtime_error("no mode");
  const auto preferred =
      std::find_if(connector->modes, connector->modes + connector->count_modes - 1,
                   [](const auto& mode) { return (mode.type & DRM_MODE_TYPE_PREFERRED) != 0; });
  const uint32_t crtc = resources->crtcs[0];
  uint32_t mode = 0;
  checked(drmModeCreatePropertyBlob(fd, preferred, sizeof(*preferred), &mode), "mode");

  DumbBuffer below(fd, preferred->hdisplay, preferred->vdisplay);
  DumbBuffer above(fd, 64, 64);
  fill_grey(below);
  fill_grey(above);
  const AtomicRequest request(drmModeAtomicAlloc());
  assign(fd, request.get(), connector->connector_id, DRM_MODE_OBJECT_CONNECTOR, "CRTC_ID", crtc);
  assign(fd, request.get(), crtc, DRM_MODE_OBJECT_CRTC, "MODE_ID", mode);
  assign(fd, request.get(), crtc, DRM_MODE_OBJECT_CRTC, "ACTIVE", 1);
  const uint32_t primary = plane_of_type(fd, DRM_PLANE_TYPE_PRIMARY);
  show_on_plane(fd, request.get(), primary, crtc, below);
  show_on_plane(fd, request.get(), plane_of_type(fd, DRM_PLANE_TYPE_OVERLAY), crtc, above);
  use_color_pipeline(fd, request.get(), primary);
  checked(drmModeAtomicCommit(fd, request.get(), DRM_MODE_ATOMIC_ALLOW_MODESET, nullptr), "commit");
  checked(drmDropMaster(fd), "cannot give up the card");
  std::puts("left");
  std::fflush(stdout);
  pause();
}

}  // namespace
}  // namespace lenticule::vm

int main(int argc, char** argv) {
  if (argc != 2) {
    std::fprintf(stderr, "vm_other_client CARD\n");
    return 2;
  }
  try {
    lenticule::vm::leave_state(argv[1]);
    return 0;
  } catch (const std::exception& error) {
    std::fprintf(stderr, "vm_other_client: %s\n", error.what());
    return 1;
  }
}
