// SPDX-License-Identifier: Apache-2.0
#include "display/kms/probe/output_choice.h"

#include <fmt/format.h>

#include <algorithm>
#include <functional>
#include <utility>

#include "display/kms/probe/pipe.h"

namespace lenticule::display {
namespace {

// --- listing --------------------------------------------------------------------------------

void add_connectors(ConnectorList& list, int fd, const std::string& card,
                    std::optional<size_t> device) {
  for (ConnectorInfo& info : read_connectors(fd, Probe::Full))
    list.connectors.push_back({card, std::move(info), device});
}

void add_device(ConnectorList& list, DrmDevice device) {
  add_connectors(list, device.fd(), device.path(), list.devices.size());
  list.devices.push_back(std::move(device));
}

// --- choosing -------------------------------------------------------------------------------

using Indices = std::vector<size_t>;

constexpr const char* kNameItsOutput =
    "name the connector of each panel in the wall's file: output = \"DP-1\"";

bool is_named(const CardConnector& candidate, const OutputRequest& request) {
  const ConnectorInfo& info = candidate.info;
  if (!request.connector.empty() && info.name != request.connector) return false;
  if (!request.card.empty() && !same_device(candidate.card, request.card)) return false;
  return request.edid.empty() || (info.edid.identity && matches(request.edid, *info.edid.identity));
}

/// Returns true if the request names one output, not a card with several ones.
bool names_one_output(const OutputRequest& request) {
  return !request.connector.empty() || !request.edid.empty();
}

/// Keeps the candidates that pass, unless none does.
void narrow(Indices& indices, const std::function<bool(size_t)>& passes) {
  Indices kept;
  std::copy_if(indices.begin(), indices.end(), std::back_inserter(kept), passes);
  if (!kept.empty()) indices = kept;
}

class Chooser {
 public:
  Chooser(const OutputRequest& request, const ConnectorList& list)
      : request_(request), list_(list) {}

  [[nodiscard]] OutputChoice choose() const {
    if (!request_.parts.empty()) return choose_parts();
    Indices indices = named();
    if (indices.empty())
      return refuse(
          ErrorKind::Device, "no such output",
          list_.connectors.empty() ? "--display virtual works without one" : "use one of those",
          true);
    std::erase_if(indices, [&](size_t i) { return !at(i).connected; });
    if (indices.empty())
      return refuse(ErrorKind::Device, "no panel is connected",
                    "switch the panel on and check its cable", true);
    if (checks_identity()) return choose_by_identity(indices);
    if (!names_one_output(request_))
      narrow(indices, [&](size_t i) {
        return choose_mode(at(i), request_.panel, std::nullopt).has_value();
      });
    return only_one(indices);
  }

  /// Returns the connected candidates on the requested output. A request by EDID does not restrict
  /// the output.
  [[nodiscard]] Indices present() const {
    Indices indices;
    for (size_t i = 0; i < list_.connectors.size(); ++i) {
      const bool here = !request_.edid.empty() || is_named(list_.connectors[i], request_);
      const bool usable = !at(i).non_desktop || !request_.connector.empty();
      if (here && usable && at(i).connected) indices.push_back(i);
    }
    return indices;
  }

 private:
  [[nodiscard]] const ConnectorInfo& at(size_t i) const { return list_.connectors[i].info; }
  [[nodiscard]] bool checks_identity() const {
    return request_.policy == IdentityPolicy::Require && !request_.identity.empty();
  }

  [[nodiscard]] Indices named() const {
    Indices indices;
    for (size_t i = 0; i < list_.connectors.size(); ++i)
      if (is_named(list_.connectors[i], request_) &&
          (!at(i).non_desktop || names_one_output(request_)))
        indices.push_back(i);
    return indices;
  }

  [[nodiscard]] OutputChoice choose_by_identity(Indices indices) const {
    std::erase_if(indices, [&](size_t i) {
      return !at(i).edid.identity || !matches(request_.identity, *at(i).edid.identity);
    });
    if (!indices.empty()) return only_one(indices);
    return refuse(ErrorKind::Input,
                  fmt::format("none is the panel that the rig was made for ({})",
                              to_string(request_.identity)),
                  "connect that panel, or use this panel's own rig", true);
  }

  /// Chooses a connector for each panel of a wall.
  [[nodiscard]] OutputChoice choose_parts() const {
    OutputChoice wall;
    for (const OutputPart& part : request_.parts) {
      OutputChoice one = Chooser(request_for(part), list_).choose();
      if (!one.chosen) {
        const bool ambiguous = part.connector.empty() && !one.may_come;
        return refuse_part(part, one.refusal.kind(), one.refusal.what(),
                           ambiguous ? kNameItsOutput : one.refusal.hint(), one.may_come);
      }
      if (at(*one.chosen).tiled)
        return refuse_part(part, ErrorKind::Device, "kms: a panel with several connectors",
                           "play it with a player of its own", false);
      if (std::ranges::find(wall.tiles, *one.chosen) != wall.tiles.end())
        return refuse_part(
            part, ErrorKind::Device,
            fmt::format("kms: {} is another panel of the wall", at(*one.chosen).name),
            kNameItsOutput, false);
      wall.tiles.push_back(*one.chosen);
      if (list_.connectors[*one.chosen].card != list_.connectors[wall.tiles.front()].card)
        return refuse_part(part, ErrorKind::Device, "kms: is on another graphics card",
                           "connect all panels to one card, or use a player in step for each card",
                           true);
    }
    wall.chosen = wall.tiles.front();
    return wall;
  }

  [[nodiscard]] OutputRequest request_for(const OutputPart& part) const {
    OutputRequest one = request_;
    one.parts.clear();
    one.connector = part.connector;
    one.identity = part.identity;
    one.panel = part.place.geometry;
    return one;
  }

  [[nodiscard]] static OutputChoice refuse_part(const OutputPart& part, ErrorKind kind,
                                                const std::string& cause, const std::string& remedy,
                                                bool may_come) {
    return {.refusal = {kind, fmt::format("panel '{}': {}", part.name, cause), remedy},
            .may_come = may_come};
  }

  [[nodiscard]] OutputChoice only_one(const Indices& indices) const {
    const Indices tiles = tiles_of(indices.front());
    const auto is_tile = [&](size_t i) { return std::ranges::find(tiles, i) != tiles.end(); };
    if (!std::ranges::all_of(indices, is_tile))
      return refuse(ErrorKind::Device, "more than one panel fits",
                    "choose one: --display kms:CONNECTOR", false);
    const ConnectorInfo& first = at(indices.front());
    if (!first.tiled) return {.chosen = tiles.front(), .tiles = tiles};
    if (!first.tile)
      return refuse(ErrorKind::Device, "the panel's tiles are not known",
                    "set the panel to single-stream transport in its menu", false);
    if (tiles.size() != static_cast<size_t>(first.tile->count()))
      return refuse(ErrorKind::Device,
                    fmt::format("the panel has {} connectors, and {} of them can be used",
                                first.tile->count(), tiles.size()),
                    "connect all of its cables to one graphics card", true);
    return {.chosen = tiles.front(), .tiles = tiles};
  }

  /// Returns the connected tiles of the panel at connector `i`, on the same card, in rows from the
  /// top left, each place once. A panel without tiles has one.
  [[nodiscard]] Indices tiles_of(size_t i) const {
    if (!at(i).tile) return {i};
    const Tile& tile = *at(i).tile;
    Indices tiles;
    for (int place = 0; place < tile.count(); ++place) {
      Tile wanted = tile;
      wanted.column = place % tile.columns;
      wanted.row = place / tile.columns;
      for (size_t n = 0; n < list_.connectors.size(); ++n)
        if (list_.connectors[n].card == list_.connectors[i].card && at(n).connected &&
            at(n).tile == wanted) {
          tiles.push_back(n);
          break;
        }
    }
    return tiles;
  }

  [[nodiscard]] OutputChoice refuse(ErrorKind kind, const std::string& cause,
                                    const std::string& remedy, bool may_come) const {
    if (list_.problem && list_.connectors.empty())
      return {.refusal = *list_.problem, .may_come = may_come};
    std::string text = "kms: " + cause;
    const char* separator = ": ";
    for (const CardConnector& candidate : list_.connectors)
      text += std::exchange(separator, "; ") + describe(candidate.info, candidate.card);
    if (list_.connectors.empty()) text += " (no graphics card has an output)";
    if (list_.problem) text += fmt::format(" ({})", list_.problem->what());
    return {.refusal = {kind, text, remedy}, .may_come = may_come};
  }

  const OutputRequest& request_;
  const ConnectorList& list_;
};

}  // namespace

ConnectorList list_connectors(const std::shared_ptr<Session>& session,
                              std::optional<DrmDevice>& previous, const OpenCard& open) {
  ConnectorList list;
  for (const DrmNode& node : find_drm_nodes()) {
    try {
      if (open.fd >= 0 && same_device(open.path, node.path))
        add_connectors(list, open.fd, open.path, std::nullopt);
      else if (previous && previous->fd() >= 0 && same_device(previous->path(), node.path))
        add_device(list, std::move(*previous));
      else
        add_device(list, DrmDevice::open(session, node));
    } catch (const Error& error) {
      list.problem = error;
    }
  }
  return list;
}

OutputChoice choose_output(const OutputRequest& request, const ConnectorList& list) {
  const Chooser chooser(request, list);
  OutputChoice choice = chooser.choose();
  choice.present = chooser.present();
  return choice;
}

}  // namespace lenticule::display
