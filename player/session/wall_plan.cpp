// SPDX-License-Identifier: Apache-2.0
#include "player/session/wall_plan.h"

#include <fmt/format.h>

#include <algorithm>

#include "base/error.h"
#include "display/scanout_format.h"
#include "optics/wall/wall.h"
#include "player/session/card_texts.h"

namespace lenticule::player {
namespace {

/// Drivers accept buffers of at most this width: one row of panels ends there.
constexpr int kWidestRow = 16384;

void refuse_flags(const PlayFlags& flags, const PlayPlan& plan) {
  const auto refuse = [](const std::string& flag) {
    throw Error(ErrorKind::Usage, flag + ": needs one rig, and a wall has several",
                "use a player for each panel: --rig, and --step for the same moment");
  };
  if (!flags.rig_store.empty()) refuse("--rig-store");
  if (flags.trim) refuse("--trim");
  if (plan.window) refuse("--display window");
}

void require_equal_bits(const optics::PlacedPanel& a, const optics::PlacedPanel& b) {
  const int bits_a = a.trimmed.rig.panel.bits, bits_b = b.trimmed.rig.panel.bits;
  if (bits_a == bits_b) return;
  throw Error(ErrorKind::Input,
              fmt::format("panel '{}' has {} bits per colour, and panel '{}' has {}", a.name,
                          bits_a, b.name, bits_b),
              "set panel.bits of both rigs to 8, or use a player for each panel");
}

/// BufferLayout places the panels side by side in one buffer, in rows.
class BufferLayout {
 public:
  void place(display::ScanoutPart& part) {
    const int width = part.geometry.width;
    if (left_ > 0 && left_ + width > kWidestRow) {
      top_ = size_.height;
      left_ = 0;
    }
    part.left_px = left_;
    part.top_px = top_;
    left_ += width;
    size_.width = std::max(size_.width, left_);
    size_.height = std::max(size_.height, top_ + part.geometry.height);
  }
  [[nodiscard]] frames::FrameGeometry size() const { return size_; }

 private:
  frames::FrameGeometry size_;
  int left_ = 0, top_ = 0;
};

}  // namespace

void plan_wall(const PlayFlags& flags, PlayPlan& plan) {
  refuse_flags(flags, plan);
  const optics::PlacedWall wall = optics::load_wall(flags.wall);
  BufferLayout buffer;
  for (const optics::PlacedPanel& panel : wall.panels) {
    require_equal_bits(wall.panels.front(), panel);
    const optics::Rig& rig = panel.trimmed.rig;
    const frames::FrameGeometry seen{.width = rig.panel.width_px, .height = rig.panel.height_px};
    display::OutputPart output{
        .name = panel.name, .connector = panel.output, .identity = rig.identity};
    output.place.mounting = rig.panel.mounting;
    output.place.geometry = display::turned(seen, rig.panel.mounting);
    buffer.place(output.place);
    plan.display.parts.push_back(std::move(output));
    plan.source.wall.push_back({.name = panel.name,
                                .panel = seen,
                                .identity = panel.trimmed.identity,
                                .rig = rig,
                                .card = rig_card(rig, panel.name)});
  }
  plan.source.panel = buffer.size();
  plan.source.rig_name = flags.wall;
  plan.display.panel = buffer.size();
  plan.display.depth = display::depth_of(wall.panels.front().trimmed.rig.panel.bits);
}

}  // namespace lenticule::player
