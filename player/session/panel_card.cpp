// SPDX-License-Identifier: Apache-2.0
#include "player/session/panel_card.h"

#include <fmt/format.h>

namespace lenticule::player {
namespace {

using display::CardText;
using display::OutputRequest;
using display::PanelInfo;
using display::PanelSearch;

constexpr const char* kContinues = "Playback continues automatically when the panel is found.";

bool is_named_by(const OutputRequest& request, const PanelInfo& panel) {
  return request.identity.empty() || (panel.identity && matches(request.identity, *panel.identity));
}

struct PanelProblem {
  const char* headline;
  std::string remedy;
};

PanelProblem problem_with(const OutputRequest& request, const PanelSearch& search,
                          const PanelInfo& panel) {
  if (!request.parts.empty()) return {"PANEL MISSING", search.refusal.hint() + ". " + kContinues};
  if (!panel.identity && !request.identity.empty())
    return {"UNKNOWN PANEL",
            fmt::format("Its EDID is {}: switch it off and on, or replace the cable. {}",
                        display::edid_problem_name(panel.edid_problem), kContinues)};
  if (!is_named_by(request, panel))
    return {
        "WRONG PANEL",
        fmt::format("Connect the expected panel. Or, if this one is right, give it a rig of its "
                    "own: 'lenticule panels' says what to write under [identity]. {}",
                    kContinues)};
  if (!search.may_come) return {"WHICH PANEL?", search.refusal.hint() + "."};
  return {
      "NO SUCH MODE",
      fmt::format("Frames fit one panel, pixel for pixel. Connect the expected panel, or use this "
                  "panel's own rig. {}",
                  kContinues)};
}

}  // namespace

std::string describe_expected(const frames::FrameGeometry& panel,
                              const optics::PanelIdentity& identity) {
  std::string text = fmt::format("{}x{} pixels", panel.width, panel.height);
  if (!identity.empty()) text += ", " + display::to_string(identity);
  return text;
}

std::string describe_found(const PanelInfo& panel) {
  std::string text = panel.connector + ": ";
  text += panel.identity ? display::to_string(*panel.identity)
                         : fmt::format("EDID {}", display::edid_problem_name(panel.edid_problem));
  if (const display::ModeInfo* mode = PanelCard::preferred_mode(panel, false))
    text += fmt::format(", {}x{}@{:.6g}", mode->width, mode->height, mode->refresh.hertz());
  return text;
}

/// Returns a row for the requested panel, or for each panel of a wall.
std::vector<CardText::Row> expected_rows(const OutputRequest& request) {
  if (request.parts.empty())
    return {{"expected", describe_expected(request.panel, request.identity)}};
  std::vector<CardText::Row> rows;
  for (const display::OutputPart& part : request.parts)
    rows.push_back(
        {rows.empty() ? "expected" : "",
         fmt::format("{}: {}{}{}", part.name, part.connector, part.connector.empty() ? "" : ", ",
                     describe_expected(part.place.geometry, part.identity))});
  return rows;
}

CardText wrong_panel_card(const OutputRequest& request, const PanelSearch& search,
                          const PanelInfo& shown_on, const std::string& rig) {
  const PanelProblem problem = problem_with(request, search, shown_on);
  CardText card{.headline = problem.headline, .rows = expected_rows(request)};
  card.rows.push_back({"state", "no-panel"});
  card.rows.push_back({"found", describe_found(shown_on)});
  // A rig may identify a panel by its EDID's checksum alone.
  if (shown_on.identity && !request.identity.edid_sha256.empty())
    card.rows.back().text += fmt::format(", EDID {}", shown_on.identity->sha256.substr(0, 12));
  for (const PanelInfo& other : search.present)
    if (other.connector != shown_on.connector) card.rows.push_back({"", describe_found(other)});
  card.rows.push_back({"rig", rig});
  card.rows.push_back({"do", problem.remedy});
  return card;
}

CardText error_card(const std::string& what, const Error& error, const std::string& state) {
  CardText card{.headline = "CANNOT PLAY",
                .rows = {{"what", what}, {"state", state}, {"why", error.what()}}};
  if (!error.hint().empty()) card.rows.push_back({"do", error.hint()});
  card.rows.push_back({"", "The player tries again automatically."});
  return card;
}

CardText rig_card(const optics::Rig& rig, const std::string& file) {
  const optics::Panel& panel = rig.panel;
  return {.headline = "TEST CARD",
          .rows = {{"rig", rig.name.empty() ? file : fmt::format("{} ({})", rig.name, file)},
                   {"panel", describe_expected({panel.width_px, panel.height_px}, rig.identity)},
                   {"sheet", fmt::format("pitch {:.6g} subpixels, slant {:.6g}, fingerprint {}",
                                         rig.sheet.pitch.value, rig.sheet.slant,
                                         optics::fingerprint(rig))}}};
}

}  // namespace lenticule::player
