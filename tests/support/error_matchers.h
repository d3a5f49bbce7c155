// SPDX-License-Identifier: Apache-2.0
// Runs a call that must throw lenticule::Error and returns the error.
#pragma once

#include <gtest/gtest.h>

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

}  // namespace lenticule::test
