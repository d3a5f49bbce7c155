// SPDX-License-Identifier: Apache-2.0
// What the key pictures of a frame show, and between which samples it may be interpolated.
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "render/integrator/packet_tracer.h"
#include "render/methods/adaptive/key_grid.h"

namespace lenticule::render {

/// How much samples may differ, in parts of a code value (lookup_kernel::kCodeParts).
struct Agreement {
  int coarse = 0;       ///< of samples twice as far apart, with none between them
  int unlike = 0;       ///< where light came another way: another shadow, another thing mirrored
  int alike = 0;        ///< where it came the same way
  int bend = 0;         ///< second difference of three samples in a row
  float apart = 0;      ///< between two pictures
  float secondary = 0;  ///< light from mirrored and refracted rays, of 1
  float around = 0;     ///< the part of free directions
  float seen = 0;       ///< and of a lamp
  float little = 0;     ///< light, of 1, that makes no difference

  /// Less light than this on its way is not told apart, and half of it will do. Dark linear light
  /// is encoded in more code values.
  [[nodiscard]] float noticed(bool colour_managed) const {
    return colour_managed ? 0.2F * little : little;
  }

  /// For an error of so many code values.
  [[nodiscard]] static Agreement for_error(double codes);
};

/// One frame's samples. Rows may be filled by different threads; cells are read-only afterwards.
class KeySamples {
 public:
  KeySamples() = default;
  explicit KeySamples(const KeyGrid& grid) { begin(grid); }
  /// Another frame, whose grid outlives its use. Where the grid is as large as the last one,
  /// samples that are not set again stay those of the frame before.
  void begin(const KeyGrid& grid);
  /// From here on, samples that are set to something else than they were count as changed.
  void watch_changes();

  /// What a sample's light is made of, see PacketTracer::Notes.
  struct Light {
    uint32_t lit = 0, hidden = 0;
    uint32_t secondary_way = 0;
    std::array<float, 3> secondary{};
    float around = 0.0F;
    /// Of lamps, in parts of kWholeLamp; kNotShining for PacketTracer::kNoShare.
    std::array<uint8_t, PacketTracer::kLamps> seen{};

    static constexpr int kWholeLamp = 240;
    static constexpr uint8_t kNotShining = 255;
    friend bool operator==(const Light&, const Light&) = default;
    [[nodiscard]] static uint8_t parts_of_lamp(float share) {
      return share < 0.0F ? kNotShining : static_cast<uint8_t>(share * kWholeLamp + 0.5F);
    }
  };
  struct Sample {
    std::array<uint16_t, 3> value{};  ///< code values, in parts
    uint32_t group = 0;               ///< SurfaceGroups
    uint32_t way = 0;                 ///< PacketTracer::Notes
    Light light{};
  };
  void set(int row, int picture, int column, const Sample& sample);

  /// Every other sample of every other row is traced first: those with even numbers.
  static constexpr int kCoarse = 2;
  /// Sets the three samples to the right of and below a coarse one to what lies between coarse
  /// ones, where those show one thing and differ little; false, and nothing set, elsewhere.
  bool fill(int top, int picture, int left, const Agreement& agreement);
  /// Whether they were, when last asked for.
  [[nodiscard]] bool is_filled(int top, int picture, int left) const {
    return filled_[index(top, picture, left)] != 0;
  }

  [[nodiscard]] const uint16_t* values() const { return values_.data(); }
  [[nodiscard]] size_t row_samples() const { return row_samples_; }

  /// Of the sample at an index [row][picture][column].
  [[nodiscard]] uint32_t group(size_t at) const { return groups_[at]; }
  [[nodiscard]] const Light& light(size_t at) const { return lights_[at]; }

  /// Marks samples that bend too much between their neighbours in their row and in those around.
  void mark_bends(int row, const Agreement& agreement);
  /// Whether a sample changed since watch_changes(), or its bends did: of the cell whose upper left
  /// corner has that index in its row, and of whole rows.
  [[nodiscard]] bool cell_changed(int row, size_t in_row) const;
  [[nodiscard]] bool rows_changed(int first, int last) const;

  /// Keys of the cells between rows `row` and `row` + 1 of a picture, see
  /// lookup_kernel::SampleRows.
  void find_cells(int row, int picture, const Agreement& agreement, uint32_t* keys) const;

 private:
  [[nodiscard]] size_t in_row(int picture, int column) const {
    return static_cast<size_t>(picture) * static_cast<size_t>(grid_->stride()) +
           static_cast<size_t>(column);
  }
  [[nodiscard]] size_t index(int row, int picture, int column) const {
    return static_cast<size_t>(row) * row_samples_ + in_row(picture, column);
  }
  [[nodiscard]] int range(size_t value) const;
  [[nodiscard]] std::array<Sample, 4> corners(int top, size_t in_row, int left) const;
  [[nodiscard]] bool is_quiet(int top, size_t in_row, int left) const;

  const KeyGrid* grid_ = nullptr;
  int rows_ = 0, columns_ = 0;
  size_t row_samples_ = 0;
  std::vector<uint16_t> values_;  ///< [row][channel][picture][column]
  std::vector<uint32_t> groups_;  ///< [row][picture][column]
  std::vector<uint32_t> ways_;
  std::vector<Light> lights_;
  std::vector<uint8_t> bends_;
  std::vector<uint8_t> filled_;  ///< of coarse samples: the three beside them
  std::vector<uint8_t> changed_;
  bool watches_changes_ = false;
};

}  // namespace lenticule::render
