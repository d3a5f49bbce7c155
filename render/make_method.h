// SPDX-License-Identifier: Apache-2.0
// Creates a render method by its name.
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "optics/model.h"
#include "render/methods/method.h"
#include "render/options/render_options.h"

namespace lenticule::render {

/// Creates the method called `name`, one of method_names(). Throws Error(Usage) with the list of
/// names for any other name. Lifetime: the model must outlive the method.
[[nodiscard]] std::unique_ptr<Method> make_method(const std::string& name,
                                                  const optics::OpticalModel& model,
                                                  const RenderOptions& options);
[[nodiscard]] const std::vector<std::string>& method_names();

}  // namespace lenticule::render
