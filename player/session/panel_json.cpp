// SPDX-License-Identifier: Apache-2.0
#include "player/session/panel_json.h"

namespace lenticule::player {
namespace {

nlohmann::json identity_as_json(const display::EdidIdentity& identity) {
  return {{"manufacturer", identity.manufacturer},
          {"product", identity.product},
          {"serial", identity.serial()},
          {"name", identity.name},
          {"edid_sha256", identity.sha256}};
}

nlohmann::json mode_as_json(const display::ModeInfo& mode) {
  return {{"width_px", mode.width},
          {"height_px", mode.height},
          {"refresh", frames::to_string(mode.refresh)},
          {"refresh_hz", mode.refresh.hertz()},
          {"preferred", mode.preferred},
          {"usable", mode.usable}};
}

nlohmann::json tile_as_json(const display::Tile& tile) {
  return {{"group", tile.group},     {"columns", tile.columns}, {"rows", tile.rows},
          {"column", tile.column},   {"row", tile.row},         {"width_px", tile.width},
          {"height_px", tile.height}};
}

}  // namespace

nlohmann::json to_json(const display::CardInfo& card) {
  nlohmann::json json = {{"path", card.path},
                         {"bus", card.bus},
                         {"driver", card.driver},
                         {"problem", card.problem},
                         {"master_available", card.master},
                         {"prefers_shadow", card.prefers_shadow},
                         {"counts_vblanks", nullptr}};
  if (card.counts_vblanks) json["counts_vblanks"] = *card.counts_vblanks;
  return json;
}

nlohmann::json to_json(const display::PanelInfo& panel) {
  nlohmann::json modes = nlohmann::json::array();
  for (const display::ModeInfo& mode : panel.modes) modes.push_back(mode_as_json(mode));
  nlohmann::json json = {{"connector", panel.connector},
                         {"card", panel.card},
                         {"connected", panel.connected},
                         {"non_desktop", panel.non_desktop},
                         {"tiled", panel.tiled},
                         {"link_bad", panel.link_bad},
                         {"variable_refresh", panel.variable_refresh},
                         {"width_mm", panel.width_mm},
                         {"height_mm", panel.height_mm},
                         {"edid", display::edid_problem_name(panel.edid_problem)},
                         {"identity", nullptr},
                         {"tile", nullptr},
                         {"modes", std::move(modes)}};
  if (panel.identity) json["identity"] = identity_as_json(*panel.identity);
  if (panel.tile) json["tile"] = tile_as_json(*panel.tile);
  return json;
}

nlohmann::json to_json(const display::ExactnessReport& report) {
  nlohmann::json rows = nlohmann::json::array();
  for (const display::AuditRow& row : report.rows)
    rows.push_back({{"object", row.object},
                    {"property", row.property},
                    {"found", row.found},
                    {"wanted", row.wanted},
                    {"now", row.now},
                    {"outcome", display::outcome_name(row.outcome)},
                    {"alters_pixels", row.alters_pixels},
                    {"effect", row.effect},
                    {"remedy", row.remedy}});
  return {{"exact", display::verdict_name(report.verdict)},
          {"proved", report.verified},
          {"reasons", report.reasons},
          {"unseen", report.unseen},
          {"remarks", report.remarks},
          {"remedies", report.remedies},
          {"properties", std::move(rows)}};
}

nlohmann::json to_json(const display::Diagnosis& diagnosis) {
  return {{"panel", to_json(diagnosis.panel)},
          {"connectors", diagnosis.connectors},
          {"driver", diagnosis.driver},
          {"problem", diagnosis.problem},
          {"remedy", diagnosis.remedy},
          {"tested", diagnosis.tested},
          {"exactness", to_json(diagnosis.exactness)}};
}

nlohmann::json to_json(const display::TileGroup& group) {
  nlohmann::json tiles = nlohmann::json::array();
  for (const display::PlacedTile& tile : group.tiles) {
    nlohmann::json place = {{"column", tile.column}, {"row", tile.row}, {"connector", nullptr}};
    if (!tile.connector.empty()) place["connector"] = tile.connector;
    tiles.push_back(std::move(place));
  }
  return {{"card", group.card},           {"group", group.group},     {"columns", group.columns},
          {"rows", group.rows},           {"width_px", group.width},  {"height_px", group.height},
          {"complete", group.complete()}, {"tiles", std::move(tiles)}};
}

nlohmann::json to_json(const display::KmsStatistics& statistics) {
  return {{"flips", statistics.flips},
          {"busy", statistics.busy},
          {"denied", statistics.denied},
          {"refused", statistics.refused},
          {"flip_timeouts", statistics.flip_timeouts},
          {"stray_events", statistics.stray_events},
          {"truncated_reads", statistics.truncated_reads},
          {"recoveries", statistics.recoveries},
          {"modesets", statistics.modesets},
          {"hotplugs", statistics.hotplugs},
          {"links_bad", statistics.links_bad},
          {"suspends", statistics.suspends},
          {"pauses", statistics.times_paused},
          {"lost_ticks", statistics.lost_ticks},
          {"one_commit", statistics.one_commit},
          {"largest_skew_us", static_cast<double>(statistics.largest_skew.count()) / 1e3},
          {"panel", display::panel_state_name(statistics.panel)},
          {"hardware_clock", statistics.hardware_clock},
          {"off", statistics.off}};
}

}  // namespace lenticule::player
