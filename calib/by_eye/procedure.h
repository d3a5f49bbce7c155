// SPDX-License-Identifier: Apache-2.0
// Calibration by eye as a state machine: keys go in, the chart to be shown and the words about it
// come out. It shows nothing, reads nothing and waits for nothing.
//
// The order matters. A wrong slant turns every fringe that a wrong pitch makes, so the slant comes
// before the pitch, and an offset means nothing before both. Every task is to make something alike
// on two sides, never to judge a number.
#pragma once

#include <cstddef>
#include <string>
#include <vector>

#include "base/terminal_keys.h"
#include "calib/by_eye/sheet_values.h"
#include "frames/charts/chart.h"
#include "optics/rig.h"

namespace lenticule::calib {

using frames::Chart;
using frames::ChartPattern;

enum class Step {
  Prepare,        ///< distance, warm panel, untouched pixels
  RoughPitch,     ///< the best band, twice
  Slant,          ///< fringes along the lenses
  Pitch,          ///< fringes that spread until one fills the panel
  Offset,         ///< left eye red, right eye green
  Check,          ///< edges against centre, all keys at once
  GapByFlips,     ///< how far apart equal pictures are
  GapByDistance,  ///< the pitch once more, from elsewhere
  NumberedViews,  ///< which view is seen, in which order
  Save,
};
inline constexpr int kSteps = 10;

/// How much one press of Stride::Normal changes.
inline constexpr double kPitchStep = 1e-4;  ///< part of the pitch
inline constexpr double kSlantStepDegrees = 0.01;
inline constexpr double kOffsetStepLenses = 0.01;
inline constexpr double kSpacingStepMm = 1.0;
inline constexpr double kDistanceStepMm = 10.0;

/// What a person is told at a step.
struct Guide {
  std::string title;               ///< "2 of 9: slant"
  std::string task;                ///< what to do, one or two sentences
  std::vector<std::string> wrong;  ///< what a fault looks like, a sentence each
  std::string keys;                ///< those that matter here
};

/// How a step is left whose value is implausible (doubt_of in sheet_values.h).
enum class Doubts {
  Ask,     ///< enter says why, enter once more takes it
  Refuse,  ///< the procedure ends with Status::Refused
  Accept,
};

class Procedure {
 public:
  enum class Status { Running, Saved, Left, Refused };

  /// The person's eye is `distance_mm` in front of the panel, on the rig's viewing height. Throws
  /// Error(Usage) for a distance from which this rig cannot be looked at.
  Procedure(const optics::Rig& rig, double distance_mm, Doubts doubts = Doubts::Ask);

  void press(const KeyPress& press);

  [[nodiscard]] Status status() const { return status_; }
  [[nodiscard]] Step step() const { return state_.step; }
  [[nodiscard]] double distance_mm() const { return distance_mm_; }
  /// The eye's distance at this step.
  [[nodiscard]] double eye_distance_mm() const;

  /// As edited, with the viewing line that it came with; always valid.
  [[nodiscard]] optics::Rig rig() const;
  /// What to draw now.
  [[nodiscard]] Chart chart() const;
  [[nodiscard]] Guide guide() const;
  /// "pitch 7.7010, slant ..., step 0.0001": what is shown, in numbers.
  [[nodiscard]] std::string numbers() const;
  /// Why the last press did nothing, or what it did that cannot be seen; may be empty.
  [[nodiscard]] const std::string& note() const { return note_; }
  /// The chart shows the rig as it was at the start.
  [[nodiscard]] bool shows_old() const { return shows_old_; }
  /// The gap was found, not taken over.
  [[nodiscard]] bool gap_was_found() const { return state_.gap_found; }
  /// Why the value of this step is implausible; empty where it is not.
  [[nodiscard]] std::string doubt() const;

 private:
  /// Everything that undo brings back.
  struct State {
    Step step = Step::Prepare;
    SheetValues sheet;
    double band_reach = 0.0;
    int cursor = 0;
    double spacing_mm = 0.0;
    double second_distance_mm = 0.0;
    double second_pitch_subpx = 0.0;
    bool second_was_seen = false;  ///< else the second pitch is what the gap predicts
    bool gap_found = false;
  };

  void press_arrow(const KeyPress& press);
  void press_control(Key key);
  void move_across(double presses);
  void move_upward(double presses);
  void change_slant(double presses);
  void change_second_distance(double presses);
  void change_second_pitch(double presses);
  void change_spacing(double presses);
  void turn_eyes();

  void next();
  [[nodiscard]] bool is_settled();
  void take_band();
  void enter(Step step);
  /// Keeps the state for undo and takes the new one, unless no valid rig belongs to it.
  bool change_to(const State& state);
  void predict_second(State& state) const;
  void travel(std::vector<State>& from, std::vector<State>& to, const char* nothing);

  [[nodiscard]] optics::Rig rig_of(const State& state) const;
  [[nodiscard]] std::string problem_of(const State& state) const;
  [[nodiscard]] double presses_of(const KeyPress& press) const;
  [[nodiscard]] ChartPattern pattern() const;

  optics::Rig start_rig_;
  double distance_mm_;
  Doubts doubts_;
  std::string asked_;  ///< the doubt that the last press of enter told
  State start_;
  State state_;
  std::vector<State> done_;
  std::vector<State> undone_;
  int coarseness_ = 0;  ///< powers of ten
  bool shows_old_ = false;
  bool other_pattern_ = false;
  bool magnifier_ = false;
  bool words_ = true;
  Status status_ = Status::Running;
  std::string note_;
};

/// What `guide()` says; in guide.cpp.
[[nodiscard]] Guide guide_of(Step step, double distance_mm, double second_distance_mm);

}  // namespace lenticule::calib
