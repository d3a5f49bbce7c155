// SPDX-License-Identifier: Apache-2.0
#include "display/kms/inspect.h"

#include <fmt/format.h>

#include <algorithm>
#include <cstring>
#include <utility>

#include "display/kms/device/connector.h"
#include "display/kms/probe/output_choice.h"
#include "display/kms/scanout/active_output.h"
#include "display/kms/scanout/kms_output.h"

namespace lenticule::display {
namespace {

ModeInfo mode_info(const drmModeModeInfo& mode, const ConnectorInfo& connector) {
  return {.width = mode.hdisplay,
          .height = mode.vdisplay,
          .refresh = refresh_of(mode),
          .preferred = is_preferred(mode),
          .native = may_be_native(connector, {mode.hdisplay, mode.vdisplay}),
          .usable = is_plain(mode)};
}

PanelInfo panel_info(const ConnectorInfo& connector, const std::string& card) {
  PanelInfo info{connector, card, connector.name, connector.edid.problem, connector.edid.identity,
                 {}};
  for (const drmModeModeInfo& mode : connector.modes)
    info.modes.push_back(mode_info(mode, connector));
  return info;
}

std::string missing_caps(const DrmCaps& caps) {
  if (caps.sufficient()) return {};
  return caps.atomic ? "the driver lacks dumb buffers or exact flip events"
                     : "the driver has no atomic modesetting";
}

/// Asks the first active CRTC; one that is off cannot be queried.
std::optional<bool> counts_vblanks(int fd) {
  const DrmResources resources(drmModeGetResources(fd));
  for (int i = 0; resources && i < resources->count_crtcs; ++i) {
    const auto table = PropertyTable::read(fd, resources->crtcs[i], DRM_MODE_OBJECT_CRTC);
    if (!table || table->value("ACTIVE") != 1) continue;
    uint64_t sequence = 0;
    uint64_t nanoseconds = 0;
    return drmCrtcGetSequence(fd, resources->crtcs[i], &sequence, &nanoseconds) == 0;
  }
  return std::nullopt;
}

/// BorrowedMastery drops DRM master when it is destroyed.
class BorrowedMastery {
 public:
  explicit BorrowedMastery(const DrmDevice& device)
      : device_(device), held_(device.session().ensure_master(device.fd()) == Mastership::Held) {}
  ~BorrowedMastery() {
    if (held_) device_.session().drop_master(device_.fd());
  }
  BorrowedMastery(const BorrowedMastery&) = delete;
  BorrowedMastery& operator=(const BorrowedMastery&) = delete;
  [[nodiscard]] bool held() const { return held_; }

 private:
  const DrmDevice& device_;
  bool held_;
};

void inspect_card(Inspection& inspection, CardInfo& card, const DrmDevice& device) {
  const BorrowedMastery mastery(device);
  card.driver = device.driver();
  card.master = mastery.held();
  card.prefers_shadow = device.caps().prefer_shadow;
  card.problem = missing_caps(device.caps());
  card.counts_vblanks = counts_vblanks(device.fd());
  for (const ConnectorInfo& connector : read_connectors(device.fd(), Probe::Full))
    inspection.panels.push_back(panel_info(connector, device.path()));
}

/// Returns true if the request names the connector, as if the connector had a panel of its own.
bool is_requested(OutputRequest request, ConnectorInfo connector, const std::string& card) {
  request.policy = IdentityPolicy::Ignore;
  connector.tiled = false;
  connector.tile.reset();
  ConnectorList list;
  list.connectors.push_back({card, connector});
  return connector.connected && !choose_output(request, list).tiles.empty();
}

/// PanelConnectors holds the connectors of a panel: one, or its tiles.
struct PanelConnectors {
  std::vector<ConnectorInfo> connectors;
  std::optional<Error> refusal{};  ///< set if a tile is missing
};

/// Takes the connectors of the panel of `first` out of those of a card.
PanelConnectors take_panel(std::vector<ConnectorInfo>& connectors, ConnectorInfo first,
                           const std::string& card) {
  const auto in_panel = [&](const ConnectorInfo& other) {
    return other.id == first.id ||
           (first.tile && other.tile && first.tile->group == other.tile->group);
  };
  ConnectorList list;
  for (const ConnectorInfo& connector : connectors)
    if (in_panel(connector)) list.connectors.push_back({card, connector});
  std::erase_if(connectors, in_panel);
  OutputRequest any_of_these;
  any_of_these.card = card;
  const OutputChoice choice = choose_output(any_of_these, list);
  if (choice.tiles.empty()) return {.connectors = {std::move(first)}, .refusal = choice.refusal};
  return {.connectors = choice.connectors_in(list)};
}

PixelSize own_size(const ConnectorInfo& connector) {
  if (const auto& tile = connector.tile)
    return {tile->columns * tile->width, tile->rows * tile->height};
  const drmModeModeInfo* const mode = preferred_mode(connector.modes);
  if (mode == nullptr)
    throw Error(ErrorKind::Device, "the panel offers no mode",
                "replace the cable, or load an EDID");
  const auto native = native_sizes(connector);
  return native.empty() ? PixelSize{mode->hdisplay, mode->vdisplay} : native.front();
}

/// Performs every step of opening a panel except the modeset.
void rehearse(Diagnosis& diagnosis, DrmDevice device, const std::vector<ConnectorInfo>& connectors,
              ScanoutDepth depth, const std::shared_ptr<KmsPlatform>& platform) {
  const int fd = device.fd();
  const PixelSize size = own_size(connectors.front());
  const frames::FrameGeometry geometry{size.width, size.height, frames::PixelFormat::Rgb8};
  OutputRequest request;
  request.panel = geometry;
  request.depth = depth;
  std::vector<Pipe> pipes = choose_pipes(fd, connectors, request);
  const ScanoutLayout layout{.geometry = geometry, .depth = pipes.front().depth};
  KmsOutput output(std::move(device), std::move(pipes), platform);
  const BorrowedMastery mastery(output.device());
  diagnosis.tested = mastery.held();
  if (!mastery.held()) {
    diagnosis.problem =
        "another program is DRM master of the card, so its outputs could not be tested";
    diagnosis.remedy = "stop the desktop session or the player, then try again";
  }
  const KmsBuffer buffer(fd, platform, layout);
  const int error = output.rehearse(buffer.framebuffer());
  diagnosis.exactness = output.report();
  if (!mastery.held() || error == 0) return;
  diagnosis.problem = fmt::format("the driver refuses its mode: {}", std::strerror(-error));
  diagnosis.remedy = "use a better cable or port, or another output";
}

Diagnosis diagnose_panel(const std::shared_ptr<Session>& session,
                         const std::shared_ptr<KmsPlatform>& platform, const DrmNode& node,
                         const PanelConnectors& panel, ScanoutDepth depth) {
  Diagnosis diagnosis{.panel = panel_info(panel.connectors.front(), node.path)};
  for (const ConnectorInfo& connector : panel.connectors)
    diagnosis.connectors.push_back(connector.name);
  try {
    DrmDevice device = DrmDevice::open(session, node);
    diagnosis.driver = device.driver();
    if (panel.refusal) throw Error(*panel.refusal);
    diagnosis.problem = missing_caps(device.caps());
    if (diagnosis.problem.empty())
      rehearse(diagnosis, std::move(device), panel.connectors, depth, platform);
  } catch (const Error& error) {
    diagnosis.problem = error.what();
    diagnosis.remedy = error.hint();
  }
  return diagnosis;
}

std::optional<Error> missing_mode(const ConnectorList& list, const OutputChoice& choice,
                                  const OutputRequest& request) {
  try {
    for (size_t n = 0; n < choice.tiles.size(); ++n)
      (void)require_mode(list.connectors[choice.tiles[n]].info, request.panel_of(n),
                         request.refresh);
  } catch (const Error& error) {
    return error;
  }
  return std::nullopt;
}

/// Returns the group of a card's panel with all places empty.
TileGroup empty_group(const std::string& card, const Tile& tile) {
  TileGroup group{.card = card,
                  .group = tile.group,
                  .columns = tile.columns,
                  .rows = tile.rows,
                  .width = tile.columns * tile.width,
                  .height = tile.rows * tile.height};
  for (int place = 0; place < tile.count(); ++place)
    group.tiles.push_back({.column = place % tile.columns, .row = place / tile.columns});
  return group;
}

bool belongs_to(const TileGroup& group, const std::string& card, const Tile& tile) {
  return group.card == card && group.group == tile.group && group.columns == tile.columns &&
         group.rows == tile.rows;
}

}  // namespace

Inspection inspect_cards(const std::shared_ptr<Session>& session) {
  Inspection inspection;
  for (const DrmNode& node : find_drm_nodes()) {
    CardInfo card{.path = node.path, .bus = node.bus};
    try {
      inspect_card(inspection, card, DrmDevice::open(session, node));
    } catch (const Error& error) {
      card.problem = error.what();
    }
    inspection.cards.push_back(std::move(card));
  }
  return inspection;
}

PanelSearch search_panel(const KmsOptions& options, const KmsDisplay* active) {
  OpenCard open;
  if (active != nullptr)
    open = {.fd = active->card_fd(), .path = active->takeover_state().card.data()};
  std::optional<DrmDevice> none;
  const ConnectorList list = list_connectors(options.session, none, open);
  const OutputChoice choice = choose_output(options.output, list);

  PanelSearch search{
      .found = !choice.tiles.empty(), .refusal = choice.refusal, .may_come = choice.may_come};
  if (search.found)
    if (auto missing = missing_mode(list, choice, options.output)) {
      search.found = false;
      search.refusal = *missing;
      search.may_come = true;  // panels may list fewer modes than they have while they wake up
    }
  for (const size_t i : choice.present)
    search.present.push_back(panel_info(list.connectors[i].info, list.connectors[i].card));
  std::sort(search.present.begin(), search.present.end(),
            [](const PanelInfo& a, const PanelInfo& b) { return a.connector < b.connector; });
  return search;
}

std::vector<Diagnosis> diagnose(const std::shared_ptr<Session>& session,
                                const OutputRequest& request,
                                const std::shared_ptr<KmsPlatform>& platform) {
  std::vector<Diagnosis> diagnoses;
  for (const DrmNode& node : find_drm_nodes()) {
    std::vector<ConnectorInfo> connectors;
    try {
      const DrmDevice device = DrmDevice::open(session, node);
      const BorrowedMastery mastery(device);
      connectors = read_connectors(device.fd(), Probe::Full);
    } catch (const Error&) {
      continue;  // inspect_cards() lists cards that cannot be opened
    }
    const auto requested = [&](const ConnectorInfo& connector) {
      return is_requested(request, connector, node.path);
    };
    const auto next = [&] { return std::ranges::find_if(connectors, requested); };
    for (auto first = next(); first != connectors.end(); first = next())
      diagnoses.push_back(diagnose_panel(session, platform, node,
                                         take_panel(connectors, *first, node.path), request.depth));
  }
  return diagnoses;
}

bool TileGroup::complete() const {
  return std::ranges::none_of(tiles, [](const PlacedTile& tile) { return tile.connector.empty(); });
}

std::vector<TileGroup> tile_groups(const std::vector<PanelInfo>& panels) {
  std::vector<TileGroup> groups;
  for (const PanelInfo& panel : panels) {
    if (!panel.connected || !panel.tile) continue;
    const Tile& tile = *panel.tile;
    auto group = std::ranges::find_if(
        groups, [&](const TileGroup& known) { return belongs_to(known, panel.card, tile); });
    if (group == groups.end()) group = groups.insert(group, empty_group(panel.card, tile));
    PlacedTile& place = group->tiles[static_cast<size_t>(tile.row * tile.columns + tile.column)];
    if (place.connector.empty()) place.connector = panel.connector;
  }
  return groups;
}

}  // namespace lenticule::display
