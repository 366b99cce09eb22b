#include "model/ops/render/radix_sort.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <numeric>
#include <random>

#include "tests/support/operation.h"

namespace vsplat {
namespace {

class RadixSort : public test::FlavourTest {
 protected:
  // Against std::stable_sort by the low `bits` bits.
  template <class Key>
  void check(long n, int bits, Key mask, bool given_values) {
    std::mt19937_64 engine(static_cast<std::uint64_t>(n * 64 + bits));
    std::vector<Key> keys(static_cast<std::size_t>(n));
    for (Key& k : keys) k = static_cast<Key>(engine()) & mask;
    std::vector<std::uint32_t> values(keys.size());
    std::iota(values.begin(), values.end(), 0u);
    if (given_values) std::shuffle(values.begin(), values.end(), engine);
    std::vector<std::size_t> order(keys.size());
    std::iota(order.begin(), order.end(), std::size_t{0});
    const Key looked_at =
        bits >= static_cast<int>(8 * sizeof(Key)) ? static_cast<Key>(~Key{0}) : static_cast<Key>((Key{1} << bits) - 1);
    std::stable_sort(order.begin(), order.end(),
                     [&](std::size_t a, std::size_t b) { return (keys[a] & looked_at) < (keys[b] & looked_at); });
    std::vector<Key> want_keys;
    std::vector<std::uint32_t> want_values;
    for (const std::size_t i : order) {
      want_keys.push_back(keys[i]);
      want_values.push_back(values[i]);
    }
    const Type type = sizeof(Key) == 8 ? Type::u64 : Type::u32;
    const Sorted got = radix_sort(ctx(), ctx().upload({n}, keys, type),
                                  given_values ? ctx().upload({n}, values, Type::u32) : Tensor(), bits);
    EXPECT_EQ(ctx().template read<Key>(got.keys), want_keys) << n << " keys, " << bits << " bits";
    EXPECT_EQ(ctx().template read<std::uint32_t>(got.values), want_values) << n << " keys, " << bits << " bits";
  }
};

TEST_P(RadixSort, SortsAnySize) {
  for (const long n : {0L, 1L, 2L, 3L, 7L, 63L, 64L, 65L, 1023L, 1024L, 1025L, 4099L, 20000L}) {
    check<std::uint32_t>(n, 32, ~0u, true);
    check<std::uint32_t>(n, 10, 0x3ffu, false);
  }
}

TEST_P(RadixSort, KeepsTheOrderOfEqualKeys) {
  check<std::uint32_t>(5000, 32, 0x3u, false);
  check<std::uint32_t>(5000, 32, 0x80000001u, true);
  check<std::uint32_t>(3000, 32, 0u, true);
}

TEST_P(RadixSort, LooksAtTheBitsAskedForOnly) {
  for (const int bits : {0, 1, 3, 4, 5, 8, 9, 13, 17, 31}) check<std::uint32_t>(777, bits, ~0u, true);
  check<std::uint32_t>(777, 0, ~0u, false);
}

TEST_P(RadixSort, SortsWideKeys) {
  for (const int bits : {1, 12, 33, 42, 64}) check<std::uint64_t>(2500, bits, ~0ull, true);
  check<std::uint64_t>(2500, 64, 0xff000000000000ffull, false);
}

TEST_P(RadixSort, RejectsBadShape) {
  EXPECT_THROW(radix_sort(ctx(), ctx().tensor({4}, Type::u32), ctx().tensor({5}, Type::u32), 32), Error);
  EXPECT_THROW(radix_sort(ctx(), ctx().tensor({4}, Type::f32), Tensor(), 32), Error);
  EXPECT_THROW(radix_sort(ctx(), ctx().tensor({4}, Type::u32), Tensor(), 33), Error);
}

VSPLAT_FLAVOURS(RadixSort);
VSPLAT_OPERATION(RadixSort, radix_sort)

}  // namespace
}  // namespace vsplat
