// SPDX-License-Identifier: Apache-2.0
// simulate_farm estimates how long a farm of many nodes takes, from figures that were measured on
// one: a discrete-event simulation of nodes that fail, one scheduler and one file system.
#pragma once

#include <cstdint>

namespace lenticule::player {

struct SimulatedFarm {
  uint64_t nodes = 10'000;
  uint64_t frames = 100'000;
  uint64_t chunk_frames = 32;
  double frame_seconds = 160.0;           ///< mean time of a frame on a node
  double frame_spread = 0.2;              ///< standard deviation over mean, of a chunk's speed
  double start_seconds = 5.0;             ///< of a process, without reading the scene
  double scene_bytes = 1e9;               ///< read by each process
  double frame_bytes = 10e6;              ///< of a compressed frame
  double failures_per_hour = 0.01;        ///< of a node
  double repair_seconds = 3600.0;         ///< until a failed node is back
  double detect_seconds = 300.0;          ///< until the scheduler gives the chunk to another node
  double starts_per_second = 100.0;       ///< tasks that the scheduler starts
  double store_bytes_per_second = 10e9;   ///< file system, all nodes together
  double node_bytes_per_second = 1e9;     ///< file system, one node
  double metadata_per_second = 20'000.0;  ///< operations on names, all nodes together
  double metadata_per_chunk = 40.0;
  double merge_bytes_per_second = 1e9;
  uint64_t seed = 1;
};

struct SimulatedRun {
  double render_seconds = 0.0;  ///< until the last chunk is done
  double merge_seconds = 0.0;
  double efficiency = 0.0;  ///< work of one run over nodes times render_seconds
  double store_busy = 0.0;  ///< part of render_seconds in which the file system transfers
  double metadata_busy = 0.0;
  double scheduler_busy = 0.0;
  double lost = 0.0;      ///< time of chunks that were lost, over the work of one run
  double repeated = 0.0;  ///< time of key frames of other chunks, over the work of one run
  uint64_t failures = 0;
};

/// Thread safety: any thread.
[[nodiscard]] SimulatedRun simulate_farm(const SimulatedFarm& farm);

}  // namespace lenticule::player
