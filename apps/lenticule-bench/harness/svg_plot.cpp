// SPDX-License-Identifier: Apache-2.0
#include "apps/lenticule-bench/harness/svg_plot.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <fstream>
#include <iterator>
#include <limits>

#include "base/error.h"
#include "base/text.h"

namespace lenticule::bench {
namespace {

constexpr double kWidth = 720.0;
constexpr double kHeight = 420.0;
constexpr double kLeft = 84.0;
constexpr double kRight = 150.0;  // space for the legend, which covers no line
constexpr double kTop = 40.0;
constexpr double kBottom = 56.0;

/// Colours that colour-blind viewers can distinguish (Okabe and Ito, and two more), dark enough on
/// white.
constexpr std::array kColours = {"#0072b2", "#d55e00", "#009e73", "#cc79a7", "#56b4e9",
                                 "#e69f00", "#000000", "#7f7f7f", "#882255", "#999933"};

/// Returns escaped(text) with & < > " ' written as entities.
std::string html_escaped(std::string_view text) {
  std::string out;
  for (const char c : escaped(text)) {
    switch (c) {
      case '&':
        out += "&amp;";
        break;
      case '<':
        out += "&lt;";
        break;
      case '>':
        out += "&gt;";
        break;
      case '"':
        out += "&quot;";
        break;
      case '\'':
        out += "&#39;";
        break;
      default:
        out += c;
    }
  }
  return out;
}

std::vector<double> linear_ticks(double low, double high) {
  constexpr double kWanted = 6.0;
  if (low > 0.0) low = 0.0;
  if (!(high > low)) high = low + 1.0;
  const double rough = (high - low) / kWanted;
  const double decade = std::pow(10.0, std::floor(std::log10(rough)));
  double step = 10.0 * decade;
  for (const double factor : {5.0, 2.0, 1.0})
    if (factor * decade >= rough * (1.0 - 1e-9)) step = factor * decade;
  // Counted in whole steps, so that rounding errors do not accumulate.
  std::vector<double> ticks;
  const double first = std::floor(low / step + 1e-9);
  const double last = std::ceil(high / step - 1e-9);
  for (double i = first; i <= last; ++i) ticks.push_back(i * step);
  return ticks;
}

std::vector<double> log_ticks(double low, double high) {
  const bool few = high < 1000.0 * low;
  const std::vector<double> factors = few ? std::vector{1.0, 2.0, 5.0} : std::vector{1.0};
  std::vector<double> ticks;
  const int end = static_cast<int>(std::ceil(std::log10(high))) + 1;
  for (int decade = static_cast<int>(std::floor(std::log10(low))); decade <= end; ++decade) {
    for (const double factor : factors) {
      const double tick = factor * std::pow(10.0, decade);
      if (tick <= low * (1.0 + 1e-9)) ticks.clear();
      ticks.push_back(tick);
      if (ticks.size() >= 2 && tick >= high * (1.0 - 1e-9)) return ticks;
    }
  }
  return ticks;
}

/// PlacedAxis maps an axis's numbers to positions in the picture.
class PlacedAxis {
 public:
  PlacedAxis(const Plot& plot, const PlotAxis& axis, double Vec2::*coordinate, double begin,
             double end)
      : log_(axis.scale == AxisScale::Log), begin_(begin), end_(end) {
    double low = std::numeric_limits<double>::infinity();
    double high = -low;
    for (const PlotSeries& series : plot.series) {
      for (const Vec2 point : series.points) {
        low = std::min(low, point.*coordinate);
        high = std::max(high, point.*coordinate);
      }
    }
    ticks_ = axis_ticks(low, high, axis.scale);
  }

  [[nodiscard]] const std::vector<double>& ticks() const { return ticks_; }
  [[nodiscard]] double place(double value) const {
    const double from = scaled(ticks_.front());
    return begin_ + (end_ - begin_) * (scaled(value) - from) / (scaled(ticks_.back()) - from);
  }

 private:
  [[nodiscard]] double scaled(double value) const { return log_ ? std::log10(value) : value; }

  bool log_;
  double begin_;
  double end_;
  std::vector<double> ticks_;
};

class SvgText {
 public:
  template <class... Arguments>
  void line(fmt::format_string<Arguments...> format, Arguments&&... arguments) {
    fmt::format_to(std::back_inserter(text_), format, std::forward<Arguments>(arguments)...);
    text_ += '\n';
  }
  [[nodiscard]] std::string take() { return std::move(text_); }

 private:
  std::string text_;
};

/// Returns 12.5, 250k, 24.9M: at most three digits, so that the labels of a crowded axis do not
/// overlap.
std::string tick_label(double value) {
  const double size = std::abs(value);
  if (size >= 1e6) return fmt::format("{:.3g}M", value / 1e6);
  if (size >= 1e3) return fmt::format("{:.3g}k", value / 1e3);
  return fmt::format("{:.4g}", value);
}

void draw_axes(SvgText& svg, const Plot& plot, const PlacedAxis& x, const PlacedAxis& y) {
  const double bottom = kHeight - kBottom;
  const double right = kWidth - kRight;
  for (const double tick : x.ticks()) {
    svg.line(R"(<path d="M{0:.1f} {1}V{2}" stroke="#ddd"/>)", x.place(tick), kTop, bottom);
    svg.line(R"(<text x="{:.1f}" y="{}" text-anchor="middle">{}</text>)", x.place(tick),
             bottom + 18, tick_label(tick));
  }
  for (const double tick : y.ticks()) {
    svg.line(R"(<path d="M{0} {1:.1f}H{2}" stroke="#ddd"/>)", kLeft, y.place(tick), right);
    svg.line(R"(<text x="{}" y="{:.1f}" text-anchor="end">{}</text>)", kLeft - 8, y.place(tick) + 4,
             tick_label(tick));
  }
  svg.line(R"(<path d="M{} {}V{}H{}" fill="none" stroke="#333"/>)", kLeft, kTop, bottom, right);
  svg.line(R"(<text x="{}" y="{}" text-anchor="middle">{}</text>)", (kLeft + right) / 2,
           kHeight - 14, html_escaped(plot.x.label));
  svg.line(R"svg(<text transform="translate(20 {}) rotate(-90)" text-anchor="middle">{}</text>)svg",
           (kTop + bottom) / 2, html_escaped(plot.y.label));
  svg.line(R"(<text x="{}" y="24" text-anchor="middle" font-size="16">{}</text>)",
           (kLeft + right) / 2, html_escaped(plot.title));
}

std::string title_of(const std::string& name) {
  return name.empty() ? name : fmt::format("<title>{}</title>", html_escaped(name));
}

void draw_points(SvgText& svg, const PlotSeries& series, const char* colour, const PlacedAxis& x,
                 const PlacedAxis& y) {
  std::string path;
  for (size_t n = 0; n < series.points.size(); ++n) {
    const Vec2 point = series.points[n];
    path += fmt::format("{}{:.1f} {:.1f}", path.empty() ? "M" : "L", x.place(point.x),
                        y.place(point.y));
    svg.line(R"(<circle cx="{:.1f}" cy="{:.1f}" r="3.5" fill="{}">{}</circle>)", x.place(point.x),
             y.place(point.y), colour, title_of(n < series.names.size() ? series.names[n] : ""));
  }
  if (series.joined)
    svg.line(R"(<path d="{}" fill="none" stroke="{}" stroke-width="2"/>)", path, colour);
}

void draw_legend(SvgText& svg, const PlotSeries& series, const char* colour, size_t index) {
  const double row = kTop + 18.0 + 20.0 * static_cast<double>(index);
  const double left = kWidth - kRight + 12.0;
  if (series.joined)
    svg.line(R"(<path d="M{} {}h20" stroke="{}" stroke-width="2"/>)", left, row - 4, colour);
  else
    svg.line(R"(<circle cx="{}" cy="{}" r="3.5" fill="{}"/>)", left + 10, row - 4, colour);
  svg.line(R"(<text x="{}" y="{}">{}</text>)", left + 26, row, html_escaped(series.label));
}

void draw_series(SvgText& svg, const Plot& plot, const PlacedAxis& x, const PlacedAxis& y) {
  for (size_t index = 0; index < plot.series.size(); ++index) {
    const char* colour = kColours[index % kColours.size()];
    draw_points(svg, plot.series[index], colour, x, y);
    draw_legend(svg, plot.series[index], colour, index);
  }
}

}  // namespace

std::vector<double> axis_ticks(double low, double high, AxisScale scale) {
  if (!std::isfinite(low) || !std::isfinite(high) || low > high)
    throw Error(ErrorKind::Usage, "plot: no points, or a value is not a finite number");
  if (scale == AxisScale::Linear) return linear_ticks(low, high);
  if (!(low > 0.0)) throw Error(ErrorKind::Usage, "plot: a logarithmic axis cannot show 0");
  return log_ticks(low, high);
}

std::string svg_of(const Plot& plot) {
  const PlacedAxis x(plot, plot.x, &Vec2::x, kLeft, kWidth - kRight);
  const PlacedAxis y(plot, plot.y, &Vec2::y, kHeight - kBottom, kTop);
  SvgText svg;
  svg.line(R"(<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {0} {1}" width="{0}" )"
           R"(height="{1}" font-family="sans-serif" font-size="13">)",
           kWidth, kHeight);
  svg.line(R"(<rect width="{}" height="{}" fill="white"/>)", kWidth, kHeight);
  draw_axes(svg, plot, x, y);
  draw_series(svg, plot, x, y);
  svg.line("</svg>");
  return svg.take();
}

void write_svg(const Plot& plot, const std::string& file) {
  std::ofstream out(file, std::ios::binary);
  out << svg_of(plot);
  out.close();
  if (!out) throw Error(ErrorKind::Failed, fmt::format("{}: cannot write", file));
}

}  // namespace lenticule::bench
