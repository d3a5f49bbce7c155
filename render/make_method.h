// SPDX-License-Identifier: Apache-2.0
// The entry to rendering: a render method by its name.
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "optics/model.h"
#include "render/methods/method.h"

namespace lenticule::render {

/// One of method_names(); throws Error(Usage) with the list of names otherwise. The model must
/// outlive it.
[[nodiscard]] std::unique_ptr<Method> make_method(const std::string& name,
                                                  const optics::OpticalModel& model,
                                                  const RenderOptions& options);
[[nodiscard]] const std::vector<std::string>& method_names();

}  // namespace lenticule::render
