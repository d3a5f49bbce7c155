// SPDX-License-Identifier: Apache-2.0
#include "display/kms/probe/pipe_choice.h"

#include <drm_fourcc.h>
#include <fmt/format.h>

#include <algorithm>
#include <optional>
#include <vector>

#include "base/error.h"
#include "display/kms/device/drm_handles.h"

namespace lenticule::display {
namespace {

bool takes_xrgb8888(const drmModePlane& plane) {
  return std::find(plane.formats, plane.formats + plane.count_formats, DRM_FORMAT_XRGB8888) !=
         plane.formats + plane.count_formats;
}

bool is_primary(int fd, uint32_t plane) {
  const auto properties = PropertyTable::read(fd, plane, DRM_MODE_OBJECT_PLANE);
  const Property* type = properties ? properties->find("type") : nullptr;
  return type != nullptr && type->value == DRM_PLANE_TYPE_PRIMARY;
}

/// Returns the CRTC's current primary plane, else an unused primary plane.
std::optional<uint32_t> primary_plane_for(int fd, uint32_t crtc, int crtc_index) {
  const DrmPlanes planes(drmModeGetPlaneResources(fd));
  std::optional<uint32_t> free_one;
  for (uint32_t i = 0; planes && i < planes->count_planes; ++i) {
    const DrmPlane plane(drmModeGetPlane(fd, planes->planes[i]));
    if (!plane || (plane->possible_crtcs & 1U << crtc_index) == 0 || !takes_xrgb8888(*plane) ||
        !is_primary(fd, plane->plane_id))
      continue;
    if (plane->crtc_id == crtc) return plane->plane_id;
    if (plane->crtc_id == 0 && !free_one) free_one = plane->plane_id;
  }
  return free_one;
}

/// Returns the CRTCs that other connectors use.
std::vector<uint32_t> crtcs_taken(int fd, uint32_t except_connector) {
  std::vector<uint32_t> taken;
  for (const ConnectorInfo& other : read_connectors(fd, Probe::Cached))
    if (other.id != except_connector)
      taken.push_back(static_cast<uint32_t>(other.properties.value("CRTC_ID")));
  return taken;
}

}  // namespace

Pipe choose_pipe(int fd, const ConnectorInfo& connector) {
  const DrmResources resources(drmModeGetResources(fd));
  if (!resources) throw Error(ErrorKind::Device, fmt::format("{}: card is gone", connector.name));
  const auto current = static_cast<uint32_t>(connector.properties.value("CRTC_ID"));
  const std::vector<uint32_t> taken = crtcs_taken(fd, connector.id);

  std::optional<Pipe> best;
  int best_rank = 0;
  for (int i = 0; i < resources->count_crtcs && i < 32; ++i) {
    const uint32_t crtc = resources->crtcs[i];
    if ((connector.possible_crtcs & 1U << i) == 0) continue;
    const bool in_use = std::find(taken.begin(), taken.end(), crtc) != taken.end();
    const int rank = crtc == current ? 3 : in_use ? 1 : 2;
    if (rank <= best_rank) continue;
    const auto plane = primary_plane_for(fd, crtc, i);
    if (!plane) continue;
    best = Pipe{.crtc = crtc, .crtc_index = i, .plane = *plane};
    best_rank = rank;
  }
  if (best) return *best;
  throw Error(ErrorKind::Device,
              fmt::format("{}: no CRTC with a primary plane for XRGB8888", connector.name),
              "disconnect another panel of this card");
}

}  // namespace lenticule::display
