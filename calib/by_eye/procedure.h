// SPDX-License-Identifier: Apache-2.0
// Procedure is calibration by eye as a state machine: keys are the input, the chart and its text
// are the output. The state machine itself does not display, read or wait.
//
// Answers to questions determine pitch, slant and offset. The later steps check these values,
// correct them and find the gap: in each the user makes two sides look alike, and never has to
// estimate a number.
#pragma once

#include <cstddef>
#include <optional>
#include <string>
#include <vector>

#include "base/terminal_keys.h"
#include "calib/by_eye/questions.h"
#include "frames/charts/charts.h"
#include "optics/rig.h"

namespace lenticule::calib {

enum class Step {
  Prepare,        ///< distance, warm panel, unchanged pixels
  RoughPitch,     ///< questions: bands of different pitch
  Slant,          ///< questions: columns of different slant
  Ladders,        ///< questions: ladders, for pitch, slant and offset
  Offset,         ///< left eye red, right eye green
  Check,          ///< edges against centre, all keys at once
  GapByFlips,     ///< distance between positions with equal pictures
  GapByDistance,  ///< the pitch again, from another distance
  NumberedViews,  ///< number and order of the views seen
  Save,
};
inline constexpr int kSteps = 10;

/// Changes by one press of Stride::Normal.
inline constexpr double kPitchStep = 1e-4;  ///< fraction of the pitch
inline constexpr double kSlantStepDegrees = 0.01;
inline constexpr double kOffsetStepLenses = 0.01;
inline constexpr double kSpacingStepMm = 1.0;
inline constexpr double kDistanceStepMm = 10.0;

/// ProcedureState holds everything that undo restores.
struct ProcedureState {
  Step step = Step::Prepare;
  SheetValues sheet;
  double spacing_mm = 0.0;
  double second_distance_mm = 0.0;
  double second_pitch_subpx = 0.0;
  bool second_was_seen = false;  ///< else the second pitch is predicted from the gap
  bool gap_found = false;
};

/// FirstLook is the start of the procedure: the rig, and the distance from the panel to the eye.
struct FirstLook {
  optics::Rig rig;
  double distance_mm = 0.0;
};

using frames::Chart;
using frames::ChartPattern;

/// Guide holds the instructions for one step.
struct Guide {
  std::string title;               ///< "2 of 9: slant"
  std::string task;                ///< the action, one or two sentences
  std::vector<std::string> wrong;  ///< appearance of faults, a sentence each
  std::string keys;                ///< the keys of this step
};

/// Doubts selects the reaction to an implausible value at the end of a step (doubt_of in
/// questions.h).
enum class Doubts {
  Ask,     ///< the first enter shows the reason, the second enter accepts the value
  Refuse,  ///< the procedure ends with Status::Refused
  Accept,
};

class Procedure {
 public:
  enum class Status { Running, Saved, Left, Refused };

  /// Starts with the user's eye `distance_mm` in front of the panel, on the rig's viewing height.
  /// Throws Error(Usage) for a distance from which this rig cannot be viewed.
  Procedure(const optics::Rig& rig, double distance_mm, Doubts doubts = Doubts::Ask);

  void press(const KeyPress& press);

  [[nodiscard]] Status status() const { return status_; }
  [[nodiscard]] Step step() const { return state_.step; }
  [[nodiscard]] double distance_mm() const { return first_.distance_mm; }
  /// Returns the eye's distance at this step.
  [[nodiscard]] double eye_distance_mm() const;

  /// Returns the edited rig with the viewing line of the original rig; always valid.
  [[nodiscard]] optics::Rig rig() const;
  /// Returns the chart to draw now.
  [[nodiscard]] Chart chart() const;
  [[nodiscard]] Guide guide() const;
  /// Returns the displayed values, for example "pitch 7.7010, slant ..., step 0.0001".
  [[nodiscard]] std::string numbers() const;
  /// Returns the reason why the last press had no effect, or its invisible effect; may be empty.
  [[nodiscard]] const std::string& note() const { return note_; }
  /// Returns true if the gap was calibrated, not taken from the original rig.
  [[nodiscard]] bool gap_was_found() const { return state_.gap_found; }
  /// Returns the reason why the value of this step is implausible; empty if it is plausible.
  [[nodiscard]] std::string doubt() const;
  [[nodiscard]] const Questions& questions() const { return questions_; }
  /// Returns true while charts are questions: arrows move the mark and enter answers.
  [[nodiscard]] bool is_asking() const;

 private:
  using State = ProcedureState;

  bool press_question(const KeyPress& press);
  void move_mark(int bands);
  void accept_answer();
  void finish_questions();
  void show_question();
  void press_arrow(const KeyPress& press);
  void press_control(Key key);

  void next();
  [[nodiscard]] bool is_settled();
  void enter(Step step);
  /// Saves the old state for undo and sets the new one, unless the new state gives no valid rig.
  bool change_to(const State& state);
  /// Goes to the last state of `from` and saves the present one. Returns false if there is none.
  bool travel(std::vector<State>& from, std::vector<State>& to);

  [[nodiscard]] double presses_of(const KeyPress& press) const;
  [[nodiscard]] ChartPattern pattern() const;

  FirstLook first_;
  Doubts doubts_;
  Questions questions_;
  std::string asked_;  ///< the doubt that the last press of enter reported
  State start_;
  State state_;
  int cursor_ = 0;             ///< the marked band of a question
  std::vector<State> done_;    ///< states before the changes, for undo
  std::vector<State> undone_;  ///< states that were undone, the last one at the end
  int coarseness_ = 0;         ///< powers of ten
  bool shows_old_ = false;
  bool other_pattern_ = false;
  bool magnifier_ = false;
  bool words_ = true;
  Status status_ = Status::Running;
  std::string note_;
};

/// Returns the text of a step, or with `is_answered` the text after the last question; implemented
/// in guide.cpp.
[[nodiscard]] Guide guide_of(Step step, bool is_answered, double distance_mm,
                             double second_distance_mm);

}  // namespace lenticule::calib
