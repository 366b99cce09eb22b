#include "model/networks/vsplat/ray_tables.h"

#include <cmath>

#include "model/networks/vsplat/ray_predictor.h"

namespace vsplat {
namespace {

constexpr double kViewBase = 10000, kTokenBase = 70007, kPlaceBase = 10000;
const double kTwoPi = 2 * std::acos(-1.0);

// Channel c of `channels` for the angle p: sine or cosine of p / base^(2 floor(c/2) / channels).
double wave(double p, long c, long channels, double base) {
  const long even = c - c % 2;
  const double angle = p / std::pow(base, static_cast<double>(even) / static_cast<double>(channels));
  return c % 2 == 0 ? std::sin(angle) : std::cos(angle);
}

}  // namespace

std::vector<float> window_positions(const Config& config) {
  const long t = config.tokens(), window = t / config.share_splits, n = config.share_dim / 2;
  const auto place = [&](long i) {
    return kTwoPi * static_cast<double>(i % window + 1) / (static_cast<double>(window) + 1e-6);
  };
  std::vector<float> view;
  for (long row = 0; row < t; ++row)
    for (long column = 0; column < t; ++column)
      for (const long at : {row, column})
        for (long c = 0; c < n; ++c) view.push_back(static_cast<float>(wave(place(at), c, n, kPlaceBase)));
  std::vector<float> out;
  for (int v = 0; v < config.share_max_views; ++v) out.insert(out.end(), view.begin(), view.end());
  return out;
}

std::vector<float> view_and_token_numbers(const Config& config) {
  const long tokens = static_cast<long>(config.tokens()) * config.tokens(), n = config.share_ray_dim;
  std::vector<double> of_token;
  for (long token = 0; token < tokens; ++token)
    for (long c = 0; c < n; ++c) of_token.push_back(wave(static_cast<double>(token), c, n, kTokenBase));
  std::vector<float> out;
  for (int v = 0; v < config.share_max_views; ++v)
    for (std::size_t i = 0; i < of_token.size(); ++i)
      out.push_back(static_cast<float>(of_token[i] + wave(v, static_cast<long>(i) % n, n, kViewBase)));
  return out;
}

TokenWindows token_windows(long t, long splits, bool shifted) {
  const long window = t / splits, shift = shifted && splits > 1 ? window / 2 : 0;
  // Regions of the grid after the cyclic shift up and left: before the last windows, in them, and, within those, what
  // was wrapped around.
  const auto part = [&](long i) { return shift == 0 ? 0 : (i >= t - window ? 1 : 0) + (i >= t - shift ? 1 : 0); };
  TokenWindows out;
  out.count = splits * splits, out.length = window * window;
  for (long w = 0; w < out.count; ++w)
    for (long i = 0; i < out.length; ++i) {
      const long row = w / splits * window + i / window, column = w % splits * window + i % window;
      out.tokens.push_back(static_cast<int>((row + shift) % t * t + (column + shift) % t));
      out.parts.push_back(static_cast<int>(3 * part(row) + part(column)));
    }
  return out;
}

AttentionGroups match_groups(Context& ctx, long views, long t, long splits, bool shifted, bool across, bool tiled) {
  const TokenWindows windows = token_windows(t, splits, shifted);
  const long n = t * t, maps = across ? views - 1 : 1, groups = views * windows.count, keys = windows.length * maps;
  std::vector<int> query_rows, key_rows, query_parts, key_parts;
  for (long view = 0; view < views; ++view)
    for (long w = 0; w < windows.count; ++w) {
      const auto first = static_cast<std::size_t>(w * windows.length);
      for (std::size_t i = first; i < first + static_cast<std::size_t>(windows.length); ++i) {
        query_rows.push_back(static_cast<int>(view * n) + windows.tokens[i]);
        query_parts.push_back(windows.parts[i]);
        for (long other = 0; other < views; ++other)  // a token's keys are contiguous
          if ((other == view) != across) key_rows.push_back(static_cast<int>(other * n) + windows.tokens[i]);
      }
      for (long j = 0; j < keys; ++j)
        key_parts.push_back(windows.parts[first + static_cast<std::size_t>(tiled ? j % windows.length : j / maps)]);
    }
  AttentionGroups out;
  out.queries = ctx.upload({groups, windows.length}, query_rows, Type::i32, "match.queries");
  out.keys = ctx.upload({groups, keys}, key_rows, Type::i32, "match.keys");
  if (shifted && splits > 1 && t / splits > 1) {
    out.query_parts = ctx.upload({groups, windows.length}, query_parts, Type::i32, "match.parts");
    out.key_parts = ctx.upload({groups, keys}, key_parts, Type::i32, "match.parts");
  }
  if (maps > 1) {
    std::vector<int> places(static_cast<std::size_t>(views * n * maps));
    std::vector<long> found(static_cast<std::size_t>(views * n), 0);
    for (std::size_t i = 0; i < key_rows.size(); ++i) {
      const auto key = static_cast<std::size_t>(key_rows[i]);
      places[key * static_cast<std::size_t>(maps) + static_cast<std::size_t>(found[key]++)] = static_cast<int>(i);
    }
    out.places = ctx.upload({views * n, maps}, places, Type::i32, "match.places");
  }
  return out;
}

}  // namespace vsplat
