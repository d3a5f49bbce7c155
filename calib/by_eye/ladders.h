// SPDX-License-Identifier: Apache-2.0
// Ladders measures how far a chart is from the true sheet, in lenses, at seven places on the panel.
// A ladder shows the same two colours on every rung, each rung shifted by a little more: the rung
// on which the colours are equal tells the difference. The differences of a flat sheet lie in a
// plane.
//
// A place is known when two answers agree. Places that then lie in no plane get a third answer
// each, so that a wrong answer or two at one place cannot tilt the plane.
#pragma once

#include <array>
#include <cstddef>
#include <optional>
#include <vector>

namespace lenticule::calib {

/// Plane is the difference between the true sheet and the chart's, in lenses.
struct Plane {
  double middle = 0.0;  ///< difference at the panel's centre
  double across = 0.0;  ///< change from the left edge to the right one
  double down = 0.0;    ///< change from top to bottom
};

/// LadderQuestion describes one ladder. Rungs are shifted by centre + reach ... centre - reach
/// lenses.
struct LadderQuestion {
  double x = 0.0, y = 0.0;  ///< distance from the panel's centre, panels; x right, y down
  double centre = 0.0;
  double reach = 0.0;
};

class Ladders {
 public:
  static constexpr int kPlaces = 7;

  /// Returns the next ladder. Must not be called when is_done().
  [[nodiscard]] LadderQuestion question() const;
  /// Adds the rung on which red above turns into green below, or a number out of range if no rung
  /// does. Returns false if the answer contradicts another one.
  bool add(int rung);

  [[nodiscard]] bool is_done() const;
  /// Returns true if ladder after ladder shows no colours that turn, if the answers do not come to
  /// an end, or if the places are far from every plane: the chart is too far from the true sheet.
  [[nodiscard]] bool is_lost() const;
  /// Returns the plane through the known places; a flat one if fewer than three are known.
  [[nodiscard]] Plane plane() const;
  /// Returns the largest distance of a known place from the plane, in lenses.
  [[nodiscard]] double misfit() const;

 private:
  static constexpr size_t kAgreeing = 2;

  struct Reading {
    double y = 0.0;
    double lenses = 0.0;  ///< modulo 1
  };
  struct Place {
    std::optional<double> rough;  ///< the answer to the ladder of all offsets
    bool is_predictable = true;   ///< false if the plane predicted a ladder without an answer
    int tries = 0;                ///< number of fine answers since `rough`
    int blanks = 0;               ///< consecutive ladders without an answer
    std::vector<Reading> readings;
  };

  [[nodiscard]] size_t open_place() const;
  [[nodiscard]] std::optional<double> expected(size_t place) const;
  [[nodiscard]] std::vector<Reading> agreeing(size_t place) const;
  [[nodiscard]] bool is_known(size_t place) const;
  [[nodiscard]] bool is_settled(size_t place) const;
  [[nodiscard]] int known_places() const;
  void look_wider(Place& place);

  std::array<Place, kPlaces> places_;
  int answers_ = 0;
  size_t needed_ = kAgreeing;  ///< number of answers that must agree at every place
};

}  // namespace lenticule::calib
