// SPDX-License-Identifier: Apache-2.0
// Returns the Error that a call throws, so that a test can check its kind and text.
#pragma once

#include <gtest/gtest.h>

#include <string>

#include "base/error.h"

namespace lenticule {

/// Fails the test and returns an Error of kind Failed if the call throws nothing or another type.
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
