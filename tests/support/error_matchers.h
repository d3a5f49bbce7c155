// SPDX-License-Identifier: Apache-2.0
// Runs a call that must throw lenticule::Error, and checks the error.
#pragma once

#include <gtest/gtest.h>

#include <string>
#include <vector>

#include "base/error.h"

namespace lenticule::test {

template <class Action>
Error error_of(Action&& action) {
  try {
    action();
  } catch (const Error& error) {
    EXPECT_EQ(std::string(error.what()).find('\n'), std::string::npos) << error.what();
    return error;
  }
  ADD_FAILURE() << "nothing was thrown";
  return Error(ErrorKind::Quality, "nothing was thrown");
}

/// Expects that an error is of this kind, and that its message and hint have all these texts.
template <typename... Text>
void expect_error(const Error& error, ErrorKind kind, const Text&... texts) {
  const std::string said = std::string(error.what()) + " / " + error.hint();
  EXPECT_EQ(error.kind(), kind) << said;
  for (const std::string& text : std::vector<std::string>{texts...})
    EXPECT_NE(said.find(text), std::string::npos) << text << " is not in: " << said;
}

}  // namespace lenticule::test
