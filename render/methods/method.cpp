// SPDX-License-Identifier: Apache-2.0
#include "render/methods/method.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include "base/error.h"
#include "render/methods/method_full.h"

namespace lenticule::render {
namespace {

constexpr int kMostSamples = 1024;
constexpr int kMostDepth = 64;
constexpr int kMostThreads = 1024;

void check_range(const char* what, int value, int low, int high) {
  if (value < low || value > high)
    throw Error(ErrorKind::Usage, fmt::format("{} {}: not in {} ... {}", what, value, low, high));
}

void check_prefilter(const std::string& method, const RenderOptions& options) {
  if (options.prefilter == Prefilter::Off) return;
  check_range("prefilter samples", options.prefilter_samples, 3, kMostSamples);
  if (method != "full")
    throw Error(ErrorKind::Usage, fmt::format("method {}: has no prefilter", method),
                "use method full");
  if (options.samples != 1)
    throw Error(ErrorKind::Usage,
                fmt::format("samples {}: cannot be combined with a prefilter", options.samples),
                "leave out --samples; --prefilter-samples sets the largest number");
}

}  // namespace

const std::vector<std::string>& method_names() {
  static const std::vector<std::string> names = {"full",     "lens-view", "interpolate",
                                                 "temporal", "hybrid",    "adaptive"};
  return names;
}

std::unique_ptr<Method> make_method(const std::string& name, const optics::OpticalModel& model,
                                    const RenderOptions& options) {
  check_range("samples", options.samples, 1, kMostSamples);
  check_range("max depth", options.max_depth, 0, kMostDepth);
  check_range("threads", options.threads, 0, kMostThreads);
  validate(options.soft);
  check_prefilter(name, options);
  if (name == "full") return make_method_full(model, options);
  if (name == "adaptive") return make_method_adaptive(model, options);
  if (const auto reuse = reuse_named(name)) {
    if (options.samples != 1)
      throw Error(ErrorKind::Usage, fmt::format("method {}: takes one sample per subpixel", name),
                  "use method full for several");
    return make_method_reuse(*reuse, model, options);
  }
  throw Error(ErrorKind::Usage, fmt::format("method '{}': unknown", name),
              fmt::format("this build has: {}", fmt::join(method_names(), ", ")));
}

}  // namespace lenticule::render
