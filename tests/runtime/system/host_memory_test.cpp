#include "runtime/system/host_memory.h"

#include <gtest/gtest.h>

#include <cmath>
#include <utility>

#include "tests/support/refusal.h"

namespace vsplat {
namespace {

class HostMemoryTest : public testing::Test {
 protected:
  ~HostMemoryTest() override { set_host_memory_limit(0); }
};

TEST_F(HostMemoryTest, IsThreeQuartersOfWhatIsFreeUntilItIsSet) {
  set_host_memory_limit(0);
  const double free = static_cast<double>(free_host_memory()), limit = static_cast<double>(host_memory_limit());
  ASSERT_GT(free, 0);
  EXPECT_NEAR(limit / free, 0.75, 0.1);  // free memory varies
  set_host_memory_limit(12345);
  EXPECT_EQ(host_memory_limit(), 12345u);
}

TEST_F(HostMemoryTest, IsReservedAndGivenBack) {
  const std::size_t before = reserved_host_memory();  // of other tests' devices
  set_host_memory_limit(before + 1000);
  {
    HostMemory a("a", 600);
    EXPECT_EQ(reserved_host_memory(), before + 600);
    const HostMemory b("b", 400);
    EXPECT_EQ(reserved_host_memory(), before + 1000);
    test::expect_error(Status::memory, {"c takes", "0 GiB are left"}, [] { HostMemory("c", 1); });
    HostMemory moved = std::move(a);
    EXPECT_EQ(moved.bytes(), 600u);
    EXPECT_EQ(reserved_host_memory(), before + 1000) << "moved, not taken twice";
    moved = HostMemory();
  }
  EXPECT_EQ(reserved_host_memory(), before);
}

TEST_F(HostMemoryTest, RefusesWhatIsNoNumberOfBytes) {
  const std::size_t before = reserved_host_memory();
  set_host_memory_limit(std::size_t{1} << 30);
  test::expect_error(Status::memory, {"x.png: decoding", "1 GiB that may be used", "(max_host_memory)"},
                     [] { HostMemory("x.png: decoding it", 1e300); });
  test::expect_error(Status::memory, {"y"}, [] { HostMemory("y", std::nan("")); });
  EXPECT_EQ(reserved_host_memory(), before);
}

}  // namespace
}  // namespace vsplat
