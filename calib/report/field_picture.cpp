// SPDX-License-Identifier: Apache-2.0
#include "calib/report/field_picture.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <iterator>
#include <limits>

#include "calib/report/plain_text.h"

namespace lenticule::calib {
namespace {

constexpr int kMaxColumns = 64;
constexpr int kMaxRows = 36;
constexpr double kFieldWidth = 320.0;

using Colour = std::array<double, 3>;
constexpr Colour kBelow = {33, 84, 160};
constexpr Colour kNone = {250, 250, 247};
constexpr Colour kAbove = {176, 82, 16};

bool is_whole(const PanelField& field) {
  return field.columns > 0 && field.rows > 0 &&
         field.values.size() ==
             static_cast<size_t>(field.columns) * static_cast<size_t>(field.rows);
}

/// Returns the cells [begin, end) of `cells` that belong to part `index` of `parts`.
std::pair<int, int> part(int index, int parts, int cells) {
  return {index * cells / parts, (index + 1) * cells / parts};
}

double mean_of(const PanelField& field, std::pair<int, int> columns, std::pair<int, int> rows) {
  double sum = 0.0;
  int count = 0;
  for (int r = rows.first; r < rows.second; ++r) {
    for (int c = columns.first; c < columns.second; ++c) {
      const double value =
          field.values[static_cast<size_t>(r) * static_cast<size_t>(field.columns) +
                       static_cast<size_t>(c)];
      if (!std::isfinite(value)) continue;
      sum += value;
      ++count;
    }
  }
  return count > 0 ? sum / count : std::numeric_limits<double>::quiet_NaN();
}

std::string svg_head(double width, double height, const std::string& what) {
  return fmt::format(R"(<svg viewBox="0 0 {0:.0f} {1:.0f}" width="{0:.0f}" height="{1:.0f}" )"
                     R"(role="img" aria-label="{2}">)",
                     width, height, html_escaped(what));
}

}  // namespace

std::string signed_colour(double share) {
  if (std::isnan(share)) return "#c4c4c4";
  const double strength = std::min(std::abs(share), 1.0);
  const Colour& end = share < 0.0 ? kBelow : kAbove;
  const auto channel = [&](size_t c) {
    return static_cast<int>(std::lround(std::lerp(kNone[c], end[c], strength)));
  };
  return fmt::format("#{:02x}{:02x}{:02x}", channel(0), channel(1), channel(2));
}

double largest_magnitude(const PanelField& field) {
  double largest = 0.0;
  for (const double value : field.values)
    if (std::isfinite(value)) largest = std::max(largest, std::abs(value));
  return largest;
}

PanelField coarser(const PanelField& field) {
  if (!is_whole(field)) return {};
  PanelField out{std::min(field.columns, kMaxColumns), std::min(field.rows, kMaxRows), {}};
  for (int r = 0; r < out.rows; ++r)
    for (int c = 0; c < out.columns; ++c)
      out.values.push_back(
          mean_of(field, part(c, out.columns, field.columns), part(r, out.rows, field.rows)));
  return out;
}

std::string field_svg(const PanelField& field, double height_over_width, double full_scale,
                      const std::string& what) {
  const PanelField cells = coarser(field);
  const double height = kFieldWidth * std::clamp(height_over_width, 0.1, 4.0);
  std::string svg = svg_head(kFieldWidth, height, what);
  const double cell_width = kFieldWidth / std::max(cells.columns, 1);
  const double cell_height = height / std::max(cells.rows, 1);
  for (size_t i = 0; i < cells.values.size(); ++i) {
    const double c = static_cast<double>(i % static_cast<size_t>(cells.columns));
    const double r = static_cast<double>(i / static_cast<size_t>(cells.columns));
    // Slightly larger than the cell, so that anti-aliasing viewers show no gaps.
    fmt::format_to(std::back_inserter(svg),
                   R"(<rect x="{:.2f}" y="{:.2f}" width="{:.2f}" height="{:.2f}" fill="{}"/>)",
                   c * cell_width, r * cell_height, cell_width + 0.3, cell_height + 0.3,
                   signed_colour(cells.values[i] / full_scale));
  }
  fmt::format_to(std::back_inserter(svg),
                 R"(<rect x="0.5" y="0.5" width="{:.1f}" height="{:.1f}" fill="none" )"
                 R"(stroke="#555"/></svg>)",
                 kFieldWidth - 1.0, height - 1.0);
  return svg;
}

std::string colour_bar_svg(double full_scale, const std::string& unit) {
  constexpr int kSteps = 40;
  constexpr double kStep = kFieldWidth / kSteps;
  std::string svg = svg_head(kFieldWidth, 34, "colours from below to above");
  for (int i = 0; i < kSteps; ++i)
    fmt::format_to(std::back_inserter(svg),
                   R"(<rect x="{:.2f}" y="0" width="{:.2f}" height="14" fill="{}"/>)", i * kStep,
                   kStep + 0.3, signed_colour(2.0 * (i + 0.5) / kSteps - 1.0));
  fmt::format_to(std::back_inserter(svg),
                 R"(<g font-size="12" fill="#222"><text x="0" y="30">-{0:.2g}</text>)"
                 R"(<text x="{1}" y="30" text-anchor="middle">0 {2}</text>)"
                 R"(<text x="{3}" y="30" text-anchor="end">+{0:.2g}</text></g></svg>)",
                 full_scale, kFieldWidth / 2, html_escaped(unit), kFieldWidth);
  return svg;
}

std::string spot_svg(const LensSpot& spot) {
  constexpr double kHeight = 150.0;
  constexpr double kGround = 120.0;
  double largest = 0.0;
  for (const double light : spot.profile)
    if (std::isfinite(light)) largest = std::max(largest, light);
  std::string svg = svg_head(kFieldWidth, kHeight, "light by place under the lens");
  const double width = kFieldWidth / static_cast<double>(std::max<size_t>(spot.profile.size(), 1));
  for (size_t bin = 0; bin < spot.profile.size(); ++bin) {
    const double light = std::isfinite(spot.profile[bin]) ? std::max(spot.profile[bin], 0.0) : 0.0;
    const double height = largest > 0.0 ? (kGround - 6.0) * light / largest : 0.0;
    fmt::format_to(std::back_inserter(svg),
                   R"(<rect x="{:.2f}" y="{:.2f}" width="{:.2f}" height="{:.2f}" fill="#2154a0"/>)",
                   static_cast<double>(bin) * width + 1.0, kGround - height,
                   std::max(width - 2.0, 0.5), height);
  }
  fmt::format_to(std::back_inserter(svg),
                 R"(<path d="M0 {0}H{1}" stroke="#333"/><g font-size="12" fill="#222">)"
                 R"(<text x="0" y="136">-0.5</text><text x="{2}" y="136" )"
                 R"(text-anchor="middle">place under the lens, lenses</text>)"
                 R"(<text x="{1}" y="136" text-anchor="end">+0.5</text></g></svg>)",
                 kGround, kFieldWidth, kFieldWidth / 2);
  return svg;
}

PanelField field_of(const optics::ResidualMap& map) {
  return {map.columns, map.rows, map.lenses};
}

}  // namespace lenticule::calib
