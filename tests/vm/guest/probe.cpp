// SPDX-License-Identifier: Apache-2.0
// Runs in the guest: lists a card's connectors and modes, and shows a picture with the simplest
// calls.
//   vm_probe list CARD                    one line per connector
//   vm_probe show CARD PPM SECONDS        shows it at its own size; prints five vblanks if any
#include <fcntl.h>
#include <poll.h>

#include <algorithm>
#include <cstdio>
#include <string>
#include <thread>
#include <vector>

#include "drm_card.h"
#include "ppm.h"

namespace lenticule::vm {
namespace {

Descriptor open_card(const std::string& path) {
  Descriptor card(checked(open(path.c_str(), O_RDWR | O_CLOEXEC), path));
  checked(drmSetClientCap(card.get(), DRM_CLIENT_CAP_UNIVERSAL_PLANES, 1), "planes");
  checked(drmSetClientCap(card.get(), DRM_CLIENT_CAP_ATOMIC, 1), "atomic");
  return card;
}

void list(const std::string& path) {
  const Descriptor card = open_card(path);
  // Writeback connectors are hidden from clients that do not ask; a driver without one ignores this
  // call.
  drmSetClientCap(card.get(), DRM_CLIENT_CAP_WRITEBACK_CONNECTORS, 1);
  const Resources resources(drmModeGetResources(card.get()));
  if (!resources) throw std::runtime_error("no KMS resources");
  for (int i = 0; i < resources->count_connectors; ++i) {
    const Connector one(drmModeGetConnector(card.get(), resources->connectors[i]));
    if (!one) continue;
    const char* type = drmModeGetConnectorTypeName(one->connector_type);
    std::printf("connector %s-%u %s %d modes\n", type ? type : "Unknown", one->connector_type_id,
                one->connection == DRM_MODE_CONNECTED ? "connected" : "not-connected",
                one->count_modes);
  }
}

struct Output {
  Connector connector;
  drmModeModeInfo mode{};
  uint32_t crtc = 0, plane = 0;
};

uint32_t primary_plane(int fd, int crtc_index) {
  const PlaneResources all(drmModeGetPlaneResources(fd));
  for (uint32_t i = 0; all && i < all->count_planes; ++i) {
    const Plane plane(drmModeGetPlane(fd, all->planes[i]));
    const bool fits = plane && (plane->possible_crtcs & (1U << crtc_index));
    if (fits && property(fd, plane->plane_id, DRM_MODE_OBJECT_PLANE, "type").value ==
                    DRM_PLANE_TYPE_PRIMARY)
      return plane->plane_id;
  }
  throw std::runtime_error("no primary plane");
}

Output find_output(int fd, uint32_t width, uint32_t height) {
  const Resources resources(drmModeGetResources(fd));
  if (!resources || resources->count_crtcs == 0) throw std::runtime_error("no CRTC");
  for (int i = 0; i < resources->count_connectors; ++i) {
    Connector one(drmModeGetConnector(fd, resources->connectors[i]));
    if (!one || one->connection != DRM_MODE_CONNECTED) continue;
    const std::span modes(one->modes, static_cast<size_t>(one->count_modes));
    const auto mode = std::find_if(modes.begin(), modes.end(), [&](const drmModeModeInfo& m) {
      return m.hdisplay == width && m.vdisplay == height && m.vrefresh == 60;
    });
    if (mode == modes.end()) continue;
    return {std::move(one), *mode, resources->crtcs[0], primary_plane(fd, 0)};
  }
  throw std::runtime_error("no connected connector has a mode of this size at 60 Hz");
}

void fill(DumbBuffer& buffer, const Ppm& picture) {
  const auto* source = picture.rgb.data();
  for (uint32_t y = 0; y < buffer.height(); ++y) {
    const std::span<uint8_t> row = buffer.row(y);
    for (size_t x = 0; x < row.size(); x += 4, source += 3) {
      row[x] = static_cast<uint8_t>(source[2]);
      row[x + 1] = static_cast<uint8_t>(source[1]);
      row[x + 2] = static_cast<uint8_t>(source[0]);
      row[x + 3] = 0;  // the fourth byte must not matter
    }
  }
}

void set_mode(int fd, const Output& output, const DumbBuffer& buffer) {
  uint32_t mode = 0;
  checked(drmModeCreatePropertyBlob(fd, &output.mode, sizeof output.mode, &mode), "mode blob");
  const AtomicRequest request(drmModeAtomicAlloc());
  assign(fd, request.get(), output.connector->connector_id, DRM_MODE_OBJECT_CONNECTOR, "CRTC_ID",
         output.crtc);
  assign(fd, request.get(), output.crtc, DRM_MODE_OBJECT_CRTC, "MODE_ID", mode);
  assign(fd, request.get(), output.crtc, DRM_MODE_OBJECT_CRTC, "ACTIVE", 1);
  const uint64_t width = buffer.width(), height = buffer.height();
  const std::pair<const char*, uint64_t> plane[] = {{"FB_ID", buffer.framebuffer()},
                                                    {"CRTC_ID", output.crtc},
                                                    {"SRC_X", 0},
                                                    {"SRC_Y", 0},
                                                    {"SRC_W", width << 16},
                                                    {"SRC_H", height << 16},
                                                    {"CRTC_X", 0},
                                                    {"CRTC_Y", 0},
                                                    {"CRTC_W", width},
                                                    {"CRTC_H", height}};
  for (const auto& [name, value] : plane)
    assign(fd, request.get(), output.plane, DRM_MODE_OBJECT_PLANE, name, value);
  checked(drmModeAtomicCommit(fd, request.get(), DRM_MODE_ATOMIC_ALLOW_MODESET, nullptr),
          "cannot set the mode");
}

void print_vblank(int, uint64_t sequence, uint64_t nanoseconds, uint64_t) {
  std::printf("vblank %llu %llu\n", static_cast<unsigned long long>(sequence),
              static_cast<unsigned long long>(nanoseconds));
}

void print_vblanks(int fd, uint32_t crtc) {
  drmEventContext context{};
  context.version = 4;
  context.sequence_handler = print_vblank;
  for (int i = 0; i < 5; ++i) {
    const uint32_t next = DRM_CRTC_SEQUENCE_RELATIVE | DRM_CRTC_SEQUENCE_NEXT_ON_MISS;
    if (drmCrtcQueueSequence(fd, crtc, next, 1, nullptr, 0) != 0) {
      std::printf("vblank none\n");
      return;
    }
    pollfd waiting{fd, POLLIN, 0};
    if (poll(&waiting, 1, 5000) != 1) throw std::runtime_error("no vblank for 5 s");
    drmHandleEvent(fd, &context);
  }
}

void show(const std::string& path, const std::string& file, int seconds) {
  const Ppm picture = read_ppm(file);
  const Descriptor card = open_card(path);
  const Output output = find_output(card.get(), picture.width, picture.height);
  DumbBuffer buffer(card.get(), picture.width, picture.height);
  fill(buffer, picture);
  set_mode(card.get(), output, buffer);
  print_vblanks(card.get(), output.crtc);
  std::printf("shown\n");
  std::fflush(stdout);
  std::this_thread::sleep_for(std::chrono::seconds(seconds));
}

int run(const std::vector<std::string>& arguments) {
  if (arguments.size() == 2 && arguments[0] == "list") {
    list(arguments[1]);
  } else if (arguments.size() == 4 && arguments[0] == "show") {
    show(arguments[1], arguments[2], std::stoi(arguments[3]));
  } else {
    std::fprintf(stderr, "vm_probe list CARD | show CARD PPM SECONDS\n");
    return 2;
  }
  return 0;
}

}  // namespace
}  // namespace lenticule::vm

int main(int argc, char** argv) {
  try {
    return lenticule::vm::run({argv + 1, argv + argc});
  } catch (const std::exception& error) {
    std::fprintf(stderr, "vm_probe: %s\n", error.what());
    return 1;
  }
}
