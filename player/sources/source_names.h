// SPDX-License-Identifier: Apache-2.0
// Names and prefixes of a SOURCE that is not a file.
#pragma once

#include <string_view>

namespace lenticule::player {

/// The SOURCE that is a test card.
inline constexpr const char* kCardSource = "card";
/// The SOURCE of generated frames: the rig's views, each showing its number.
inline constexpr const char* kViewsSource = "views";
/// "ring:SOCKET": frames of another process.
inline constexpr std::string_view kRingSource = "ring:";
/// "views:PATTERN", "views:A|B": a picture or a video per view.
inline constexpr std::string_view kViewFiles = "views:";

}  // namespace lenticule::player
