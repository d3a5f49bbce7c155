// SPDX-License-Identifier: Apache-2.0
// Provides rigs for tests: a few well-known ones and random valid ones of every kind.
#pragma once

#include <random>

#include "optics/rig.h"

namespace lenticule::test {

/// Returns a rig of 27 inches, 3840x2160, RGB, 7.701 subpixels, slant 0.2521, seen from 700 mm.
optics::Rig kiosk_rig();

/// Returns a rig with upright lenses of 8 whole pixels and parallel viewing zones.
optics::Rig upright_rig();

/// Returns a random rig: panels up to 15360x8640, slants of both signs, zero and 45 degrees,
/// stripes and cells, residual maps, channel offsets, finite and infinite viewing distances. The
/// rig is always valid and depends on the generator's state only.
optics::Rig random_rig(std::mt19937_64& random);

/// Returns a smooth random map of at most `lenses` lenses.
optics::ResidualMap random_residual(std::mt19937_64& random, int columns, int rows, double lenses);

}  // namespace lenticule::test
