#include "model/ops/render/radix_sort.h"

#include <algorithm>
#include <numeric>

#include "model/diagnose/selftest/cases/cases.h"

namespace vsplat::selftest {
namespace {

template <class Key>
void sort_of(Checks& c, long n, int bits, bool given, Key mask = static_cast<Key>(~Key{0})) {
  std::mt19937_64 engine(static_cast<std::uint64_t>(n * 64 + bits));
  std::vector<Key> keys(size_of(n));
  for (Key& k : keys) k = static_cast<Key>(engine()) & mask;
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
  if (!c.all) return;
  for (const long n : {0L, 1L, 2L, 3L, 7L, 63L, 64L, 65L, 1023L, 1024L, 1025L, 4099L, 20000L}) {
    sort_of<std::uint32_t>(c, n, 32, true);
    sort_of<std::uint32_t>(c, n, 10, false, 0x3ffu);
  }
  // The order of equal keys stays.
  sort_of<std::uint32_t>(c, 5000, 32, false, 0x3u);
  sort_of<std::uint32_t>(c, 5000, 32, true, 0x80000001u);
  sort_of<std::uint32_t>(c, 3000, 32, true, 0u);
  for (const int bits : {0, 1, 3, 4, 5, 8, 9, 13, 17, 31}) sort_of<std::uint32_t>(c, 777, bits, true);
  sort_of<std::uint32_t>(c, 777, 0, false);
  for (const int bits : {1, 12, 33, 42, 64}) sort_of<std::uint64_t>(c, 2500, bits, true);
  sort_of<std::uint64_t>(c, 2500, 64, false, 0xff000000000000ffull);
}

}  // namespace

VSPLAT_CASES(radix_sort, {"radix_sort", radix_sort_all})

}  // namespace vsplat::selftest
