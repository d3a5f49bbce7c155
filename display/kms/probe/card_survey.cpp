// SPDX-License-Identifier: Apache-2.0
#include "display/kms/probe/card_survey.h"

#include <fmt/format.h>

#include <utility>

namespace lenticule::display {
namespace {

void add_candidates(CardSurvey& survey, int fd, const std::string& path,
                    std::optional<size_t> device) {
  for (ConnectorInfo& connector : read_connectors(fd, Probe::Full)) {
    survey.candidates.push_back({path, std::move(connector)});
    survey.device_of.push_back(device);
  }
}

void add_device(CardSurvey& survey, DrmDevice device) {
  add_candidates(survey, device.fd(), device.path(), survey.devices.size());
  survey.devices.push_back(std::move(device));
}

}  // namespace

CardSurvey survey_cards(const std::shared_ptr<Session>& session,
                        std::optional<DrmDevice>& inherited, const OpenCard& open) {
  CardSurvey survey;
  for (const DrmNode& node : find_drm_nodes()) {
    try {
      if (open.fd >= 0 && same_device(open.path, node.path))
        add_candidates(survey, open.fd, open.path, std::nullopt);
      else if (inherited && inherited->fd() >= 0 && same_device(inherited->path(), node.path))
        add_device(survey, std::move(*inherited));
      else
        add_device(survey, DrmDevice::open(session, node));
    } catch (const Error& error) {
      survey.problem = error;
    }
  }
  return survey;
}

Error refusal(const OutputChoice& choice, const CardSurvey& survey) {
  if (!survey.problem) return {choice.kind, choice.cause, choice.remedy};
  if (survey.candidates.empty()) return *survey.problem;
  return {choice.kind, fmt::format("{} ({})", choice.cause, survey.problem->what()), choice.remedy};
}

}  // namespace lenticule::display
