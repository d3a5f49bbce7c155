// SPDX-License-Identifier: Apache-2.0
// UndoHistory remembers the states of a procedure before its changes.
#pragma once

#include <vector>

#include "calib/by_eye/procedure_state.h"

namespace lenticule::calib {

class UndoHistory {
 public:
  /// Remembers a state that is about to change; what was undone cannot be done again.
  void add(const ProcedureState& before);
  /// Goes to the state before the last change. Returns false if there is none.
  [[nodiscard]] bool undo(ProcedureState& state);
  /// Goes back to the state that was undone last. Returns false if there is none.
  [[nodiscard]] bool redo(ProcedureState& state);
  void clear();

 private:
  static bool travel(ProcedureState& state, std::vector<ProcedureState>& from,
                     std::vector<ProcedureState>& to);

  std::vector<ProcedureState> done_;
  std::vector<ProcedureState> undone_;
};

}  // namespace lenticule::calib
