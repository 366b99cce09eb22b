// Sums, sorting, and rows by index.
#include <algorithm>
#include <array>
#include <numeric>

#include "model/diagnose/selftest/cases/cases.h"
#include "model/diagnose/selftest/reference/scan.h"
#include "model/diagnose/selftest/reference/scatter_rows.h"
#include "model/diagnose/selftest/reference/top_k.h"
#include "model/ops/dense/gather.h"
#include "model/ops/dense/scatter_rows.h"
#include "model/ops/render/radix_sort.h"
#include "model/ops/render/scan.h"
#include "model/ops/volume/compact.h"
#include "model/ops/volume/top_k.h"

namespace vsplat::selftest {
namespace {

std::size_t list_size(long a, long b = 1) { return static_cast<std::size_t>(a * b); }

void scan_all(Checks& c) {
  for (const long n : c.some({1L, 3L, 63L, 64L, 65L, 1023L, 1024L, 1025L, 40001L})) {
    std::mt19937 engine(static_cast<unsigned>(n));
    std::vector<std::uint32_t> in(list_size(n));
    for (auto& v : in) v = engine() % 1000;
    const Tensor out = c.up({n + 1}, std::vector<std::uint32_t>(list_size(n + 1), 7));
    exclusive_scan(c.ctx, c.up({n}, in), out);
    c.equal("sums", out, ref::exclusive_scan(in));
  }
}

template <class Key>
void sort_of(Checks& c, long n, int bits, bool given) {
  std::mt19937_64 engine(static_cast<std::uint64_t>(n * 64 + bits));
  std::vector<Key> keys(list_size(n));
  for (Key& k : keys) k = static_cast<Key>(engine());
  std::vector<std::uint32_t> values(keys.size()), order(keys.size());
  std::iota(order.begin(), order.end(), 0u);
  values = order;
  if (given) std::shuffle(values.begin(), values.end(), engine);
  const auto low = [&](std::uint32_t i) {
    return bits >= static_cast<int>(8 * sizeof(Key)) ? keys[i] : keys[i] & ((Key{1} << bits) - 1);
  };
  std::stable_sort(order.begin(), order.end(), [&](auto a, auto b) { return low(a) < low(b); });
  std::vector<Key> sorted;
  std::vector<std::uint32_t> moved;
  for (const auto i : order) sorted.push_back(keys[i]), moved.push_back(values[i]);
  const Sorted got = radix_sort(c.ctx, c.ctx.upload({n}, keys, sizeof(Key) == 8 ? Type::u64 : Type::u32),
                                given ? c.up({n}, values) : Tensor(), bits);
  c.equal("keys", got.keys, sorted);
  c.equal("values", got.values, moved);
}

void radix_sort_all(Checks& c) {
  for (const long n : c.some({1L, 3L, 7L, 63L, 64L, 65L, 1023L, 1025L, 9001L})) {
    sort_of<std::uint32_t>(c, n, 32, true);
    sort_of<std::uint32_t>(c, n, 9, false);
    sort_of<std::uint64_t>(c, n, 33, true);
  }
}

void compact_all(Checks& c) {
  for (const long n : c.some({1L, 3L, 63L, 64L, 65L, 4099L})) {
    std::vector<std::uint32_t> flags(list_size(n));
    std::mt19937 engine(3);
    for (auto& f : flags) f = engine() % 3 == 0;
    flags.back() = 1;
    std::vector<int> want;
    for (std::size_t i = 0; i < flags.size(); ++i)
      if (flags[i]) want.push_back(static_cast<int>(i));
    c.equal("indices", compact(c.ctx, c.up({n}, flags), 0), want);
  }
}

void top_k_all(Checks& c) {
  for (const long n : c.some({1L, 7L, 63L, 65L, 1009L})) {
    auto x = random_floats(list_size(n), 1);
    for (std::size_t i = 0; i < x.size(); i += 3) x[i] = 0.25f;  // equal ones, too
    for (const long k : {1L, n / 3, n}) {
      const Tensor flags = c.up({n}, std::vector<std::uint32_t>(x.size(), 7)),
                   others = c.up({n}, std::vector<std::uint32_t>(x.size(), 7));
      top_k(c.ctx, {c.up({n}, x), k, flags, others});
      const auto want = ref::top_k(x, list_size(k));
      c.equal("largest", flags, want);
      auto rest = want;
      for (auto& v : rest) v = 1 - v;
      c.equal("others", others, rest);
    }
  }
}

void gather_all(Checks& c) {
  const std::vector<int> index = {4, 0, 6, 1, 5, 20, 18};
  for (const long width : c.some({1L, 3L, 16L, 33L, 65L})) {
    const std::size_t w = list_size(width), wide = w + 3;
    const auto x = random_floats(7 * w, 1);
    for (const long shared : {1L, 3L}) {
      std::vector<int> rows = index;
      if (shared == 1) rows.resize(5);
      if (shared > 1) std::sort(rows.begin(), rows.end());
      const long p = static_cast<long>(rows.size());
      std::vector<float> want(rows.size() * wide, 9.0f);
      const auto row = [&](std::size_t i) { return static_cast<std::size_t>(rows[i]) / list_size(shared); };
      for (std::size_t i = 0; i < rows.size() * w; ++i) want[i / w * wide + 2 + i % w] = x[row(i / w) * w + i % w];
      const Tensor out = c.up({p, width + 3}, std::vector<float>(want.size(), 9.0f));
      gather_forward(c.ctx, {c.up({7, width}, x), c.up({p}, rows), out, 2, shared});
      c.equal("rows", out, want);
      const auto dout = random_floats(want.size(), 2), before = random_floats(7 * w, 3);
      std::vector<double> sums(before.begin(), before.end());
      for (std::size_t i = 0; i < rows.size() * w; ++i) sums[row(i / w) * w + i % w] += dout[i / w * wide + 2 + i % w];
      const Tensor dx = c.up({7, width}, before);
      gather_backward(c.ctx, {c.up({p, width + 3}, dout), c.up({p}, rows), dx, 2, shared});
      c.close("rows, backward", dx, sums, 1e-6);
    }
  }
  const std::vector<int> x = {5, -1, 1 << 30, 7}, at = {2, 0, 0, 3, 1};
  c.equal("integers", gather_integers(c.ctx, c.up({4}, x), c.up({5}, at)), std::vector<int>{1 << 30, 5, 5, 7, -1});
}

void scatter_rows_all(Checks& c) {
  struct Try {
    long entries, rows, channels, per_row;
    long first = 0;
    float scale = 1;
  };
  for (const Try& t : c.some({Try{1, 1, 1, 1},
                              {7, 5, 6, 1},
                              {63, 2, 4, 1},
                              {64, 3, 5, 1},
                              {65, 257, 3, 1},
                              {101, 7, 17, 1},
                              {240, 11, 18, 4},
                              {97, 11, 33, 4, 13, 0.25f},
                              {4099, 2, 1, 4}})) {
    std::vector<int> index(list_size(t.entries));
    std::mt19937 engine(5);
    for (int& i : index) i = static_cast<int>(engine() % static_cast<unsigned>(t.rows + 1)) - 1;
    index[0] = 0;
    const auto weight = random_floats(index.size(), 6, 0.1f, 2.0f);
    const long used = t.first + (t.entries + t.per_row - 1) / t.per_row;
    const auto d = random_floats(list_size(used, t.channels), 7),
               before = random_floats(list_size(t.rows, t.channels), 8);
    std::vector<double> want(before.begin(), before.end());
    ref::scatter_rows(index, weight, d, list_size(t.channels), list_size(t.first), list_size(t.per_row),
                      static_cast<double>(t.scale), want);
    const ScatterPlan plan = make_scatter_plan(c.ctx, c.up({t.entries}, index), c.up({t.entries}, weight), t.rows);
    const Tensor out = c.up({t.rows, t.channels}, before);
    scatter_rows(c.ctx, {&plan, c.up({used, t.channels}, d), t.first, t.per_row, t.scale, out});
    c.close("sums", out, want, 1e-6);
  }
}

}  // namespace

std::vector<Case> list_cases() {
  return {{"scan", scan_all},   {"radix_sort", radix_sort_all}, {"compact", compact_all},
          {"top_k", top_k_all}, {"gather", gather_all},         {"scatter_rows", scatter_rows_all}};
}

}  // namespace vsplat::selftest
