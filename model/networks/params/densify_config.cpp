#include "model/networks/params/densify_config.h"

#include <fmt/format.h>

namespace vsplat {
namespace {

constexpr std::pair<const char*, CurveName> kCurves[] = {
    {"z", {false, false}}, {"z-trans", {false, true}}, {"hilbert", {true, false}}, {"hilbert-trans", {true, true}}};

// 2^16 of these, as many cells as a curve has bits for along an axis, span six units
constexpr double kLeastCell = 1e-4;

// Splits at commas.
std::vector<std::string> parts_of(const std::string& text) {
  std::vector<std::string> out;
  for (std::size_t at = 0; at <= text.size();) {
    const std::size_t comma = std::min(text.find(',', at), text.size());
    out.push_back(text.substr(at, comma - at));
    at = comma + 1;
  }
  return out;
}

const CurveName* curve_called(const std::string& name) {
  for (const auto& [known, curve] : kCurves)
    if (name == known) return &curve;
  return nullptr;
}

}  // namespace

std::vector<CurveName> curves_of(const DensifyConfig& config) {
  std::vector<CurveName> out;
  for (const std::string& name : parts_of(config.orders))
    if (const CurveName* curve = curve_called(name)) out.push_back(*curve);
  return out;
}

void check(const DensifyConfig& c, const FieldChecks& is) {
  const std::size_t levels = c.levels();
  is.need(levels >= 1 && levels <= 8, "densify.channels must have 1 to 8 entries", levels);
  const std::tuple<const char*, const std::vector<int>*, int> lists[] = {{"densify.channels", &c.channels, 4096},
                                                                         {"densify.heads", &c.heads, 4096},
                                                                         {"densify.depths", &c.depths, 64},
                                                                         {"densify.patch", &c.patch, 4096},
                                                                         {"densify.upscale", &c.upscale, 64}};
  for (const auto& [name, list, most] : lists) {
    is.need(list->size() == levels, fmt::format("{} must have as many entries as densify.channels", name),
            list->size());
    for (const int entry : *list) is.within(name, entry, 1, most);
  }
  for (std::size_t s = 0; s < levels; ++s) {
    is.need(c.channels[s] % c.heads[s] == 0, "densify.channels must be multiples of densify.heads",
            fmt::format("{} and {}", c.channels[s], c.heads[s]));
    is.need(c.upscale[s] > 1, "densify.upscale must be at least 2", c.upscale[s]);
  }
  is.within("densify.top_k", c.top_k, 1, 1 << 24);
  is.within("densify.mlp_ratio", c.mlp_ratio, 1, 64);
  is.within("densify.stride", c.stride, 1, 64);
  is.within("densify.frequencies", c.frequencies, 1, 30);
  is.in("densify.non_leaf_ratio", c.non_leaf_ratio, c.non_leaf_ratio > 0 && c.non_leaf_ratio < 1, "in (0,1)");
  is.in("densify.cell", c.cell, c.cell >= kLeastCell && c.cell <= 1, "in [0.0001,1]");
  is.in("densify.opacity_threshold", c.opacity_threshold, c.opacity_threshold >= 0 && c.opacity_threshold < 1,
        "in [0,1)");
  is.one_of("densify.duplicates", c.duplicates, {"spconv", "all"});
  const std::vector<std::string> orders = parts_of(c.orders);
  for (const std::string& name : orders)
    if (curve_called(name) == nullptr) is.one_of("densify.orders", name, {"z", "z-trans", "hilbert", "hilbert-trans"});
  is.need(orders.size() <= 16, "densify.orders must have 1 to 16 curves", orders.size());
  double points = c.top_k, widest = 0;
  for (std::size_t s = 0; s < levels; ++s) {
    widest = std::max(widest, points * 3 * c.channels[s]);
    points *= c.upscale[s];
    widest = std::max(widest, points * (c.channels[s] + 6.0 * c.frequencies));
  }
  is.indexable("the densifier's values, its points times its widths,", widest);
}

}  // namespace vsplat
