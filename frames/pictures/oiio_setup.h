// SPDX-License-Identifier: Apache-2.0
// OpenImageIO's process-wide settings. Only for the files of this module.
#pragma once

namespace lenticule::frames::pictures {

/// No threads of its own, no huge allocations. Cheap after the first call; safe from any thread.
void set_up_oiio();

}  // namespace lenticule::frames::pictures
