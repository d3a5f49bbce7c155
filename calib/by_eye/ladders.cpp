// SPDX-License-Identifier: Apache-2.0
#include "calib/by_eye/ladders.h"

#include <Eigen/Core>
#include <algorithm>
#include <cmath>

#include "calib/linear_algebra.h"
#include "frames/charts/chart.h"
#include "optics/effective_sheet.h"

namespace lenticule::calib {
namespace {

using frames::kBands;
using optics::without_whole_lenses;

struct Position {
  double x, y;
};

/// Positions of the ladders, in panels from the centre. The bend of a sheet whose gap is not known
/// disturbs the edges least if the outer ladders are at 0.43. The two inner ones make sure that a
/// pitch or slant that is wrong by whole lenses from ladder to ladder does not look right.
constexpr std::array<Position, Ladders::kPlaces> kPositions = {
    Position{0.0, 0.0}, {-0.43, -0.36}, {0.43, -0.36}, {0.43, 0.36},
    {-0.43, 0.36},      {0.17, 0.15},   {-0.2, 0.13}};

/// More than half a lens: the colours turn inside the ladder, not at its end.
constexpr double kRoughReach = 0.62;
constexpr double kFineReach = 0.12;
/// Shift of every second fine ladder, so that equal answers are not equal rungs.
constexpr double kFineShift = 0.02;
/// Answers within this range agree.
constexpr double kAgreement = 0.03;
/// Distance from the plane above which every place gets another answer.
constexpr double kSuspiciousMisfit = 0.01;
/// Distance from the plane that no sheet has.
constexpr double kHopelessMisfit = 0.15;
constexpr size_t kMostNeeded = 3;
constexpr int kLeastForPlane = 3;
constexpr int kMostTries = 4;
constexpr int kMostBlanks = 3;
constexpr int kMostAnswers = 50;

}  // namespace

size_t Ladders::open_place() const {
  size_t place = 0;
  while (place < kPlaces - 1 && is_settled(place)) ++place;
  return place;
}

/// Returns the value to expect at a place: predicted by other places, or known from a ladder of all
/// offsets.
std::optional<double> Ladders::expected(size_t place) const {
  if (places_.at(place).is_predictable && known_places() >= kLeastForPlane) {
    const Plane flat = plane();
    const Position at = kPositions.at(place);
    return flat.middle + flat.across * at.x + flat.down * at.y;
  }
  return places_.at(place).rough;
}

LadderQuestion Ladders::question() const {
  const size_t place = open_place();
  const Position at = kPositions.at(place);
  const std::optional<double> centre = expected(place);
  if (!centre) return {.x = at.x, .y = at.y, .centre = 0.0, .reach = kRoughReach};
  const bool odd = places_.at(place).readings.size() % 2 != 0;
  return {.x = at.x,
          .y = at.y,
          .centre = *centre + (odd ? kFineShift : -kFineShift),
          .reach = kFineReach};
}

bool Ladders::add(int rung) {
  const LadderQuestion asked = question();
  const size_t index = open_place();
  Place& place = places_.at(index);
  ++answers_;
  if (rung < 0 || rung >= kBands) {
    ++place.blanks;
    look_wider(place);
    return false;
  }
  place.blanks = 0;
  const double lenses =
      asked.centre + frames::band_shift(frames::ChartPattern::Ladder, rung, asked.reach);
  if (asked.reach == kRoughReach) {
    place.rough = lenses;
    return true;
  }
  place.readings.push_back({frames::rung_y(asked.y, rung), lenses});
  const bool fits = agreeing(index).size() == place.readings.size();
  if (++place.tries >= kMostTries && !is_settled(index)) look_wider(place);
  if (is_done() && needed_ < kMostNeeded && misfit() > kSuspiciousMisfit) ++needed_;
  return fits;
}

/// Makes the next ladder at this place one of all offsets.
void Ladders::look_wider(Place& place) {
  place.rough.reset();
  place.is_predictable = false;
  place.tries = 0;
}

/// Returns the largest group of answers at a place that agree.
std::vector<Ladders::Reading> Ladders::agreeing(size_t place) const {
  std::vector<Reading> most;
  for (const Reading& lowest : places_.at(place).readings) {
    std::vector<Reading> group;
    for (const Reading& other : places_.at(place).readings) {
      const double above = without_whole_lenses(other.lenses - lowest.lenses);
      if (above >= 0.0 && above <= kAgreement) group.push_back(other);
    }
    if (group.size() > most.size()) most = std::move(group);
  }
  return most;
}

bool Ladders::is_known(size_t place) const {
  return agreeing(place).size() >= kAgreeing;
}

bool Ladders::is_settled(size_t place) const {
  return agreeing(place).size() >= needed_;
}

int Ladders::known_places() const {
  int count = 0;
  for (size_t place = 0; place < kPlaces; ++place) count += is_known(place) ? 1 : 0;
  return count;
}

bool Ladders::is_done() const {
  for (size_t place = 0; place < kPlaces; ++place)
    if (!is_settled(place)) return false;
  return true;
}

bool Ladders::is_lost() const {
  if (is_done()) return misfit() > kHopelessMisfit;
  if (answers_ >= kMostAnswers) return true;
  return std::any_of(places_.begin(), places_.end(),
                     [](const Place& place) { return place.blanks >= kMostBlanks; });
}

Plane Ladders::plane() const {
  Eigen::Matrix3d normal = Eigen::Matrix3d::Zero();
  Eigen::Vector3d right = Eigen::Vector3d::Zero();
  std::optional<double> first;
  for (size_t place = 0; place < kPlaces; ++place) {
    if (!is_known(place)) continue;
    const std::vector<Reading> group = agreeing(place);
    if (!first) first = group.front().lenses;
    for (const Reading& reading : group) {
      const Eigen::Vector3d at(1.0, kPositions.at(place).x, reading.y);
      const double lenses = *first + without_whole_lenses(reading.lenses - *first);
      // Every place has the same weight.
      normal += at * at.transpose() / static_cast<double>(group.size());
      right += at * lenses / static_cast<double>(group.size());
    }
  }
  if (!first) return {};
  if (known_places() < kLeastForPlane) return {.middle = *first, .across = 0.0, .down = 0.0};
  const Eigen::Vector3d solved = solve_symmetric(normal, right);
  return {.middle = solved.x(), .across = solved.y(), .down = solved.z()};
}

double Ladders::misfit() const {
  const Plane flat = plane();
  double largest = 0.0;
  for (size_t place = 0; place < kPlaces; ++place) {
    if (!is_known(place)) continue;
    const std::vector<Reading> group = agreeing(place);
    double mean = 0.0;
    for (const Reading& reading : group) {
      const double there =
          flat.middle + flat.across * kPositions.at(place).x + flat.down * reading.y;
      mean += without_whole_lenses(reading.lenses - there) / static_cast<double>(group.size());
    }
    largest = std::max(largest, std::abs(mean));
  }
  return largest;
}

}  // namespace lenticule::calib
