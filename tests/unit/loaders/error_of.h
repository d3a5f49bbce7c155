// SPDX-License-Identifier: Apache-2.0
// The Error that a call throws, so that a test can look at its kind and words.
#pragma once

#include <gtest/gtest.h>

#include <string>

#include "base/error.h"

namespace lenticule {

/// Fails the test, and returns an Error of kind Failed, if nothing or something else is thrown.
template <class Call>
Error error_of(Call call) {
  try {
    call();
  } catch (const Error& error) {
    return error;
  }
  ADD_FAILURE() << "no error was thrown";
  return {ErrorKind::Failed, "no error"};
}

}  // namespace lenticule
