#include "svg_chart.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <nlohmann/json.hpp>

namespace command {
namespace {

constexpr double width = 560, height = 220, left = 58, right = 22, top = 10, bottom = 26;

std::string number(double value, int digits = 4) {
  char text[32];
  std::snprintf(text, sizeof text, "%.*g", digits, value);
  return text;
}

// "250k" for 250000.
std::string tick_text(double value) {
  if (std::abs(value) >= 1e6) return number(value / 1e6) + "M";
  return std::abs(value) >= 1e4 ? number(value / 1e3) + "k" : number(value);
}

std::string pixel(double value) {
  char text[32];
  std::snprintf(text, sizeof text, "%.1f", value);
  return text;
}

struct Axis {
  double low, high, begin, end;  // values, and their pixels
  bool logarithmic = false;

  double at(double value) const {
    const double share = logarithmic ? std::log(value / low) / std::log(high / low) : (value - low) / (high - low);
    return begin + share * (end - begin);
  }
  // Four to ten round values.
  std::vector<double> ticks() const {
    std::vector<double> out;
    if (logarithmic) {
      const int first = static_cast<int>(std::floor(std::log10(low))), last = static_cast<int>(std::log10(high));
      for (int power = first; power <= last; ++power)
        for (const double times : {1.0, 2.0, 5.0}) {
          const double tick = std::pow(10, power) * times;
          if (tick >= low && tick <= high) out.push_back(tick);
        }
      if (out.size() >= 2) return out;
      out.clear();
    }
    const double rough = (high - low) / 5, decade = std::pow(10, std::floor(std::log10(rough)));
    const double step = decade * (rough > 5 * decade ? 10 : rough > 2 * decade ? 5 : rough > decade ? 2 : 1);
    const double first = std::ceil(low / step);
    for (int i = 0; i < 10; ++i)
      if (const double tick = (first + i) * step; tick <= high * (1 + 1e-12)) out.push_back(tick);
    return out;
  }
};

Curve drawable(const Curve& curve, bool logarithmic) {
  Curve out;
  for (std::size_t i = 0; i < curve.x.size(); ++i)
    if (std::isfinite(curve.x[i]) && std::isfinite(curve.y[i]) && (!logarithmic || curve.y[i] > 0)) {
      out.x.push_back(curve.x[i]);
      out.y.push_back(curve.y[i]);
    }
  return out;
}

Axis vertical(const Curve& curve, const Chart& chart) {
  const auto [least, most] = std::minmax_element(curve.y.begin(), curve.y.end());
  Axis out{*least, *most, height - bottom, top, chart.logarithmic};
  if (chart.logarithmic) {
    out.low /= 1.05, out.high *= 1.05;
    return out;
  }
  if (chart.from_zero) out.low = 0;
  // Values that rounding may tell apart count as equal: ticks must differ.
  const double size = std::max(std::abs(out.low), std::abs(out.high)), spread = out.high - out.low;
  const double margin = spread > 1e-9 * size ? 0.05 * spread : std::max(1e-6, 0.05 * size);
  if (!chart.from_zero) out.low -= margin;
  out.high += margin;
  return out;
}

std::string line(double x1, double y1, double x2, double y2, const char* kind) {
  return std::string("<line class=\"") + kind + "\" x1=\"" + pixel(x1) + "\" y1=\"" + pixel(y1) + "\" x2=\"" +
         pixel(x2) + "\" y2=\"" + pixel(y2) + "\"/>";
}

std::string axes(const Axis& x, const Axis& y) {
  std::string out;
  for (const double tick : y.ticks())
    out += line(left, y.at(tick), width - right, y.at(tick), "grid") + "<text text-anchor=\"end\" x=\"" +
           pixel(left - 6) + "\" y=\"" + pixel(y.at(tick) + 4) + "\">" + tick_text(tick) + "</text>";
  for (const double tick : x.ticks())
    out += "<text text-anchor=\"middle\" x=\"" + pixel(x.at(tick)) + "\" y=\"" + pixel(height - 8) + "\">" +
           tick_text(tick) + "</text>";
  return out + line(left, height - bottom, width - right, height - bottom, "axis");
}

}  // namespace

std::string html_text(const std::string& text) {
  // The library's JSON writer replaces what is no UTF-8.
  const std::string valid =
      nlohmann::json::parse(nlohmann::json(text).dump(-1, ' ', false, nlohmann::json::error_handler_t::replace))
          .get<std::string>();
  std::string out;
  for (const char c : valid) {
    const auto byte = static_cast<unsigned char>(c);
    if (c == '&')
      out += "&amp;";
    else if (c == '<')
      out += "&lt;";
    else if (c == '>')
      out += "&gt;";
    else if (c == '"')
      out += "&quot;";
    else if (c == '\'')
      out += "&#39;";
    else if ((byte < 0x20 && c != '\n' && c != '\t') || byte == 0x7f)
      out += "\xef\xbf\xbd";
    else
      out += c;
  }
  return out;
}

Curve thinned(const Curve& curve, std::size_t most) {
  const std::size_t count = curve.x.size();
  if (count <= most) return curve;
  Curve out;
  for (std::size_t bin = 0; bin < most; ++bin) {
    const std::size_t from = bin * count / most, to = (bin + 1) * count / most;
    std::vector<double> values;
    for (std::size_t i = from; i < to; ++i)
      if (std::isfinite(curve.y[i])) values.push_back(curve.y[i]);
    if (values.empty()) continue;
    const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
    std::nth_element(values.begin(), middle, values.end());
    out.x.push_back(curve.x[(from + to - 1) / 2]);
    out.y.push_back(*middle);
  }
  return out;
}

std::string svg_chart(const Curve& curve, const Chart& chart) {
  const std::string head = "<section class=\"card chart\"><header>" + html_text(chart.title) +
                           " <span class=\"soft\">" + html_text(chart.unit) + "</span></header>";
  const Curve points = drawable(curve, chart.logarithmic);
  if (points.x.empty()) return head + "<p class=\"soft\">Nothing was measured.</p></section>\n";
  const auto [first, last] = std::minmax_element(points.x.begin(), points.x.end());
  const Axis x{std::min(0.0, *first), std::max(*last, *first + 1), left, width - right}, y = vertical(points, chart);
  std::string path, dots;
  for (std::size_t i = 0; i < points.x.size(); ++i) {
    const std::string px = pixel(x.at(points.x[i])), py = pixel(y.at(points.y[i]));
    path += (i == 0 ? "M" : "L") + px + " " + py;
    if (chart.dots || points.x.size() == 1)
      dots += "<circle class=\"dot\" cx=\"" + px + "\" cy=\"" + py + "\" r=\"2.6\"><title>step " +
              number(points.x[i], 9) + ": " + number(points.y[i], 5) + " " + html_text(chart.unit) +
              "</title></circle>";
  }
  std::string marks;
  for (const double mark : chart.marks) marks += line(x.at(mark), top, x.at(mark), height - bottom, "mark");
  return head + "<svg role=\"img\" aria-label=\"" + html_text(chart.title) + "\" viewBox=\"0 0 " + number(width) + " " +
         number(height) + "\">" + axes(x, y) + marks + "<path class=\"curve\" d=\"" + path + "\"/>" + dots +
         "</svg></section>\n";
}

}  // namespace command
