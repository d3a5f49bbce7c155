// SPDX-License-Identifier: Apache-2.0
#include "calib/fit/own_cameras.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "calib/fit/projection.h"

namespace lenticule::calib {
namespace {

/// Pulls are differences in standard deviations of the priors. Below this pull the phases change by
/// less than 0.004 lens.
constexpr double kNotablePull = 0.5;
constexpr double kMostFocalPull = 3.0;
/// A shift of the axis along the line of the places may have happened at any of them; above this
/// pull the phases could be off by more than 0.02 lens.
constexpr double kMostCentrePull = 1.6;

double focal_pull(const OwnCameraValues& own) {
  return std::abs(own[kOwnFocal]) / kOwnFocalSigma;
}
double centre_pull(const OwnCameraValues& own) {
  return std::hypot(own[kOwnCentreX], own[kOwnCentreY]) / kOwnCentreSigma;
}
double pull(const OwnCameraValues& own) {
  return std::max(focal_pull(own), centre_pull(own));
}
bool zoomed(const OwnCameraValues& own) {
  return focal_pull(own) >= centre_pull(own);
}

/// Returns the difference between a view's camera and the mean of the others.
OwnCameraValues apart_from_others(const std::vector<OwnCameraValues>& own, size_t view) {
  OwnCameraValues apart = own[view];
  const double others = static_cast<double>(own.size() - 1);
  for (size_t v = 0; v < own.size(); ++v)
    for (size_t k = 0; v != view && k < apart.size(); ++k) apart[k] -= own[v][k] / others;
  return apart;
}

/// Returns a difference in words, without the name of the view.
std::string words_for(const OwnCameraValues& apart) {
  if (zoomed(apart))
    return fmt::format("the focal length is {:.1f} % {} than at the other places",
                       100.0 * std::abs(apart[kOwnFocal]),
                       apart[kOwnFocal] > 0.0 ? "longer" : "shorter");
  return fmt::format(
      "the axis of the camera is {:.2f} % of the picture's longer side from where it is at the "
      "other places",
      100.0 * std::hypot(apart[kOwnCentreX], apart[kOwnCentreY]));
}

}  // namespace

bool differ_notably(const std::vector<OwnCameraValues>& own) {
  return std::ranges::any_of(own, [](const auto& one) { return pull(one) > kNotablePull; });
}

bool contradict(const std::vector<OwnCameraValues>& own) {
  return std::ranges::any_of(own, [](const auto& one) {
    return focal_pull(one) > kMostFocalPull || centre_pull(one) > kMostCentrePull;
  });
}

std::string sentence_about(const std::vector<Suspect>& suspects) {
  if (suspects.empty())
    return "the camera differs from place to place: photograph all places again, with the same "
           "zoom, focus and size of the pictures";
  std::string all;
  for (const Suspect& suspect : suspects)
    all +=
        fmt::format("{}{}: {}", all.empty() ? "" : ", or ", suspect.name, words_for(suspect.own));
  const bool zoom = zoomed(suspects.front().own);
  return fmt::format("{}: {}; photograph {} again", all,
                     zoom ? "the camera zoomed, focused anew, or uses another lens"
                          : "the pictures are cropped, or the stabiliser moved the lens",
                     suspects.size() == 1 ? "this place" : "these places");
}

std::vector<std::string> notes_of(const std::vector<View>& views,
                                  const std::vector<OwnCameraValues>& own) {
  // If one of three views differs, the common camera is in between, and the others are off by half.
  constexpr double kOutstanding = 0.6;
  const double most = pull(*std::ranges::max_element(own, {}, pull));
  std::vector<std::string> notes;
  for (size_t v = 0; v < own.size(); ++v)
    if (pull(own[v]) > std::max(kNotablePull, kOutstanding * most))
      notes.push_back(fmt::format("{}: {}; the fit takes this into account", views[v].name,
                                  words_for(apart_from_others(own, v))));
  return notes;
}

}  // namespace lenticule::calib
