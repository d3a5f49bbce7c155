// SPDX-License-Identifier: Apache-2.0
// What the samples around a subpixel that is shaded by itself settle of its light.
#pragma once

#include <array>
#include <cstdint>
#include <limits>
#include <vector>

#include "render/methods/adaptive/key_samples.h"

namespace lenticule::render {

/// What is known of a subpixel's lamps with a size.
struct SettledLamps {
  std::array<uint16_t, PacketTracer::kLamps> seen{};   ///< in parts of kWholeLamp
  std::array<uint16_t, PacketTracer::kLamps> apart{};  ///< by how much samples differ, the same

  static constexpr int kWholeLamp = 256 * KeySamples::Light::kWholeLamp;
};

/// Small, since it is sorted by the million. That is why lamps lie elsewhere.
struct SettledLight {
  uint32_t lit = 0, hidden = 0;  ///< as in PacketTracer::Notes: what all samples agree on
  float secondary = 0.0F;        ///< only where it is known
  float around = 0.0F;           ///< only where it is known
  uint32_t lamps = 0;            ///< number of its SettledLamps, if any lamp is known
  bool secondary_known = false;
  bool around_known = false;
  uint8_t lamps_known = 0;  ///< a bit for each lamp of which a known share is

  /// What rays of sampled light are wanted for: the first lamp that is not known, or one of these.
  uint8_t wanted = kNoSamples;

  static constexpr uint8_t kAllSamples = PacketTracer::kLamps;  ///< around, or too little is known
  static constexpr uint8_t kNoSamples = PacketTracer::kLamps + 1;
  static_assert(PacketTracer::kLamps <= 8, "a bit for each lamp");
};

/// Of one thread and frame. What the four samples around a cell say is asked once for all subpixels
/// that see into it.
class LightSettler {
 public:
  /// `samples` and `grid` must outlive it, and must not change. `soft`: what is sampled.
  LightSettler(const KeySamples& samples, const KeyGrid& grid, const Agreement& agreement,
               bool colour_managed, const SoftLight& soft);

  /// Where a point lies in a picture beside its view, see lookup_kernel::Found.
  struct Place {
    int cell;      ///< -1 outside
    float part;    ///< of the way to the cell's right column
    float weight;  ///< of the picture
    size_t odd;    ///< 1 of pictures with odd numbers
  };
  struct Point {
    KeyGrid::Between rows;
    std::array<Place, 2> places;
    uint32_t group;  ///< the surface seen
    int channel;
  };
  /// Only samples that show the surface count; there must be a few. Appends to `lamps` where some
  /// are known.
  void settle(const Point& point, SettledLight& out, std::vector<SettledLamps>& lamps);
  /// Whether no sample around it changed (KeySamples::cell_changed).
  [[nodiscard]] bool is_as_before(const KeyGrid::Between& rows,
                                  const std::array<Place, 2>& places) const;

 private:
  /// Of the corners on which a lamp would shine: how many, and the parts that are seen from them.
  struct Lamps {
    std::array<uint8_t, PacketTracer::kLamps> count{}, least, most{};

    Lamps() { least.fill(KeySamples::Light::kNotShining); }
    void add(const KeySamples::Light& light);
    void add(const Lamps& other);
  };
  /// What the corners of a cell that show a surface agree on.
  struct Corners {
    static constexpr float kMost = std::numeric_limits<float>::infinity();
    uint32_t group = 0;
    int row = -1;  ///< of the upper two
    int count = 0;
    bool same_way = true;
    uint32_t way = 0;
    uint32_t lit = ~0U, hidden = ~0U;
    std::array<float, 3> low{kMost, kMost, kMost}, high{-kMost, -kMost, -kMost};
    float least_around = 1.0F, most_around = 0.0F;

    void add(const KeySamples::Light& light);
    void add(const Corners& other);
  };
  const Corners& corners_of(const Point& point, const Place& place);
  /// Calls `use(index, weight)` for each corner of a cell.
  template <class Use>
  void each_corner(const Point& point, const Place& place, const Use& use) const;
  [[nodiscard]] SettledLamps settle_lamps(const Point& point, SettledLight& out) const;
  void blend(const Point& point, SettledLight& out) const;
  void blend_lamps(const Point& point, SettledLamps& out) const;

  const KeySamples& samples_;
  const KeyGrid& grid_;
  Agreement agreement_;
  bool colour_managed_, finds_around_, finds_lamps_;
  std::vector<Corners> remembered_;      ///< by place in a row of samples
  std::vector<Lamps> remembered_lamps_;  ///< the same, if any are to be found
};

}  // namespace lenticule::render
