// Curves as inline SVG, for pages without scripts. Colours are those of runtime/profile/page.css.
#pragma once
#include <string>
#include <vector>

namespace command {

// Text for HTML and SVG: &, <, >, and quotes are escaped, so that no name can end an element or an attribute; invalid
// UTF-8 and control characters become U+FFFD.
std::string html_text(const std::string& text);

struct Curve {
  std::vector<double> x, y;  // of equal lengths; points that are not finite are left out
};

struct Chart {
  std::string title, unit;
  bool logarithmic = false;   // along y; values up to 0 are left out
  bool from_zero = false;     // the y axis begins at 0
  bool dots = false;          // a dot at each point, with its values as a tooltip
  std::vector<double> marks;  // x of vertical lines
};

// At most `most` points: medians of neighbours.
Curve thinned(const Curve& curve, std::size_t most);

std::string svg_chart(const Curve& curve, const Chart& chart);

}  // namespace command
