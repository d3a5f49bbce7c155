// SPDX-License-Identifier: Apache-2.0
#include "display/kms/survey/panel_search.h"

#include <algorithm>
#include <optional>

#include "display/kms/probe/card_survey.h"
#include "display/kms/probe/mode_choice.h"
#include "display/kms/survey/panel_facts.h"

namespace lenticule::display {
namespace {

std::optional<Error> missing_mode(const ConnectorInfo& connector, const KmsOptions& options) {
  try {
    (void)require_mode(connector, options.wish.panel, options.refresh);
  } catch (const Error& error) {
    return error;
  }
  return std::nullopt;
}

}  // namespace

PanelSearch search_panel(const KmsOptions& options, const KmsDisplay* lit) {
  OpenCard open;
  if (lit != nullptr) open = {.fd = lit->card_fd(), .path = lit->handover().card.data()};
  std::optional<DrmDevice> none;
  const CardSurvey survey = survey_cards(options.session, none, open);
  const OutputChoice choice = choose_output(options.wish, survey.candidates);

  PanelSearch search{.found = choice.chosen.has_value(),
                     .refusal = refusal(choice, survey),
                     .may_come = choice.may_come};
  if (choice.chosen)
    if (auto missing = missing_mode(survey.candidates[*choice.chosen].connector, options)) {
      search.found = false;
      search.refusal = *missing;
      search.may_come = true;  // panels may list fewer modes than they have while they wake up
    }
  for (const size_t i : choice.present)
    search.present.push_back(
        panel_facts(survey.candidates[i].connector, survey.candidates[i].card));
  std::sort(search.present.begin(), search.present.end(),
            [](const PanelFacts& a, const PanelFacts& b) { return a.connector < b.connector; });
  return search;
}

}  // namespace lenticule::display
