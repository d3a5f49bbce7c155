// SPDX-License-Identifier: Apache-2.0
// Lists the connectors of all cards, and finds the one that a request means, or the reason why
// there is not exactly one. The order of cards and connectors never decides.
#pragma once

#include <cstddef>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "base/error.h"
#include "display/kms/device/connector.h"
#include "display/kms/device/drm_device.h"
#include "display/kms/device/session.h"
#include "display/kms/probe/output_request.h"

namespace lenticule::display {

struct CardConnector {
  std::string card;  ///< path of the card's node
  ConnectorInfo info;
  /// Index in ConnectorList::devices; none if the list did not open the card.
  std::optional<size_t> device{};
};

struct ConnectorList {
  std::vector<DrmDevice> devices{};
  std::vector<CardConnector> connectors{};
  std::optional<Error> problem{};  ///< error of a card that could not be opened
};

/// A card that this process has already open: only its DRM master can probe connectors again.
struct OpenCard {
  int fd = -1;  ///< borrowed
  std::string path{};
};

/// Opens all cards and probes every connector, which may take hundreds of milliseconds each. If
/// `previous`, the descriptor of the previous player, is one of the cards, it is used, because it
/// is DRM master already, and `previous` is reset.
[[nodiscard]] ConnectorList list_connectors(const std::shared_ptr<Session>& session,
                                            std::optional<DrmDevice>& previous,
                                            const OpenCard& open = {});

struct OutputChoice {
  std::optional<size_t> chosen{};  ///< index in ConnectorList::connectors
  /// All connectors of the chosen panel, in rows from its top left, or of a wall's panels in the
  /// order of the request; `chosen` is the first.
  std::vector<size_t> tiles{};
  /// If none was chosen: the error, and whether waiting for a panel may help.
  Error refusal{ErrorKind::Device, ""};
  bool may_come = false;
  /// Connectors with a panel of any identity on the requested output.
  std::vector<size_t> present{};
};

[[nodiscard]] OutputChoice choose_output(const OutputRequest& request, const ConnectorList& list);

}  // namespace lenticule::display
