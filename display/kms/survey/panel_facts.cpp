// SPDX-License-Identifier: Apache-2.0
#include "display/kms/survey/panel_facts.h"

#include "display/kms/probe/mode_choice.h"

namespace lenticule::display {
namespace {

ModeFacts mode_facts(const drmModeModeInfo& mode, const ConnectorInfo& connector) {
  return {.width = mode.hdisplay,
          .height = mode.vdisplay,
          .refresh = refresh_of(mode),
          .preferred = is_preferred(mode),
          .native = may_be_native(connector, {mode.hdisplay, mode.vdisplay}),
          .usable = is_plain(mode)};
}

}  // namespace

PanelFacts panel_facts(const ConnectorInfo& connector, const std::string& card) {
  PanelFacts facts{.card = card,
                   .connector = connector.name,
                   .connected = connector.connected,
                   .non_desktop = connector.non_desktop,
                   .tiled = connector.tiled,
                   .link_bad = connector.link_bad,
                   .width_mm = connector.width_mm,
                   .height_mm = connector.height_mm,
                   .edid_problem = connector.edid.problem,
                   .identity = connector.edid.identity,
                   .modes = {}};
  for (const drmModeModeInfo& mode : connector.modes)
    facts.modes.push_back(mode_facts(mode, connector));
  return facts;
}

}  // namespace lenticule::display
