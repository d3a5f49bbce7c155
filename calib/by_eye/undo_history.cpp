// SPDX-License-Identifier: Apache-2.0
#include "calib/by_eye/undo_history.h"

#include <cstddef>

namespace lenticule::calib {
namespace {

constexpr size_t kMaxUndo = 10'000;

}  // namespace

void UndoHistory::add(const ProcedureState& before) {
  if (done_.size() >= kMaxUndo) done_.erase(done_.begin());
  done_.push_back(before);
  undone_.clear();
}

bool UndoHistory::undo(ProcedureState& state) {
  return travel(state, done_, undone_);
}

bool UndoHistory::redo(ProcedureState& state) {
  return travel(state, undone_, done_);
}

void UndoHistory::clear() {
  done_.clear();
  undone_.clear();
}

bool UndoHistory::travel(ProcedureState& state, std::vector<ProcedureState>& from,
                         std::vector<ProcedureState>& to) {
  if (from.empty()) return false;
  to.push_back(state);
  state = from.back();
  from.pop_back();
  return true;
}

}  // namespace lenticule::calib
