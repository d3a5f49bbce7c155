// SPDX-License-Identifier: Apache-2.0
#pragma once

namespace lenticule::frames::capture {

/// GrabStatus is the result of an attempt to get a picture from a camera.
enum class GrabStatus {
  Ready,     ///< a whole picture
  TimedOut,  ///< no picture before the deadline; the camera is still usable
  Corrupt,   ///< the picture is damaged and was dropped; grab again
  Gone,      ///< unplugged or permanently broken; failure() has the cause
};

}  // namespace lenticule::frames::capture
