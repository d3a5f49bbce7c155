// SPDX-License-Identifier: Apache-2.0
// OpenImageIO's process-wide settings. Include only from the files of this library.
#pragma once

namespace lenticule::frames::pictures {

/// Configures OpenImageIO to start no threads and to refuse huge allocations. Cheap after the first
/// call.
///
/// Thread safety: any thread.
void set_up_oiio();

}  // namespace lenticule::frames::pictures
