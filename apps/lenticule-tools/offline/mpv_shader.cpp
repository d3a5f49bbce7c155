// SPDX-License-Identifier: Apache-2.0
#include "apps/lenticule-tools/offline/mpv_shader.h"

#include <fmt/format.h>

#include "base/error.h"

namespace lenticule::tools {
namespace {

void refuse(const char* key, const char* cause) {
  throw Error(ErrorKind::Input, fmt::format("mpv shader: {}: {}", key, cause),
              "use lenticule play, which weaves for such a rig");
}

std::string constants(const optics::Rig& rig, const frames::QuiltLayout& layout) {
  const optics::EffectiveSheet sheet = optics::effective_sheet(rig);
  const double per_pixel = 3.0 / sheet.pitch.value;
  std::string text;
  const auto add = [&](const std::string& name, double value) {
    text += fmt::format("const float {} = {:.9e};\n", name, value);
  };
  add("WIDTH", rig.panel.width_px);
  add("HEIGHT", rig.panel.height_px);
  add("COLUMNS", layout.columns);
  add("ROWS", layout.rows);
  add("VIEWS", layout.view_count());
  add("LENSES_PER_PIXEL", per_pixel);
  add("LENSES_PER_ROW", per_pixel * rig.sheet.slant);
  add("OFFSET", optics::without_whole_lenses(sheet.offset.value));
  for (int c = 0; c < 3; ++c) {
    const optics::SubpixelOffset& offset = rig.panel.layout.offset(0, 0, c);
    const char name = "RGB"[c];
    add(fmt::format("{}_X", name),
        offset.x_px + rig.sheet.channel_offset[static_cast<size_t>(c)].value / 3.0);
    add(fmt::format("{}_Y", name), offset.y_px);
  }
  return text;
}

/// Tile 0 is at the bottom left; texture rows count from the top.
constexpr const char* kBody = R"(
float woven(vec2 pixel, vec2 inside, int channel) {
    vec2 at = pixel + inside;
    float phase = (at.x - WIDTH / 2.0) * LENSES_PER_PIXEL
                + (at.y - HEIGHT / 2.0) * LENSES_PER_ROW + OFFSET;
    float place = phase - floor(phase + 0.5);
    float view = clamp(floor(VIEWS * (0.5 - place)), 0.0, VIEWS - 1.0);
    float tile_row = floor((view + 0.5) / COLUMNS);
    float tile_column = view - COLUMNS * tile_row;
    vec2 tile = HOOKED_size / vec2(COLUMNS, ROWS);
    vec2 inner = clamp((pixel + 0.5) / vec2(WIDTH, HEIGHT) * tile, vec2(0.5), tile - 0.5);
    vec2 texel = vec2(tile_column, ROWS - 1.0 - tile_row) * tile + inner;
    return HOOKED_tex(texel / HOOKED_size)[channel];
}

vec4 hook() {
    vec2 pixel = floor(HOOKED_pos * vec2(WIDTH, HEIGHT));
    return vec4(woven(pixel, vec2(R_X, R_Y), 0), woven(pixel, vec2(G_X, G_Y), 1),
                woven(pixel, vec2(B_X, B_Y), 2), 1.0);
}
)";

}  // namespace

std::string mpv_shader(const optics::Rig& rig, const frames::QuiltLayout& layout) {
  check_quilt_layout(layout, "mpv shader");
  if (!rig.panel.mounting.upright())
    refuse("panel.mounting", "a picture that is turned after weaving");
  if (!rig.sheet.residual.empty()) refuse("sheet.residual", "a residual map");
  if (rig.panel.layout.columns() * rig.panel.layout.rows() != 1)
    refuse("panel.layout", "a cell table");
  return fmt::format(
             "// A quilt of {} x {} tiles, {} views, for rig {}. Play it full screen at {} x {}\n"
             "// without scaling, cropping or colour management.\n"
             "//!HOOK MAIN\n//!BIND HOOKED\n//!WIDTH {}\n//!HEIGHT {}\n//!DESC lenticule weave\n",
             layout.columns, layout.rows, layout.view_count(), optics::fingerprint(rig),
             rig.panel.width_px, rig.panel.height_px, rig.panel.width_px, rig.panel.height_px) +
         constants(rig, layout) + kBody;
}

}  // namespace lenticule::tools
