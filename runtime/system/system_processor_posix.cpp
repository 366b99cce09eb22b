#include "runtime/system/system_processor.h"

#ifdef __x86_64__
#include <cpuid.h>
#endif
#if defined(__x86_64__) && defined(__linux__)
#include <sys/syscall.h>
#include <unistd.h>
#endif

namespace vsplat {

#ifdef __x86_64__
bool has_avx512bf16() { return __builtin_cpu_supports("avx512bf16"); }
#else
bool has_avx512bf16() { return false; }
#endif

#if defined(__x86_64__) && defined(__linux__)
bool may_use_amx() {
  constexpr unsigned bf16 = 1u << 22, tiles = 1u << 24;
  constexpr int ask = 0x1023, tile_data = 18;  // ARCH_REQ_XCOMP_PERM, XFEATURE_XTILEDATA
  unsigned a = 0, b = 0, c = 0, d = 0;
  if (!__get_cpuid_count(7, 0, &a, &b, &c, &d) || (d & bf16) == 0 || (d & tiles) == 0) return false;
  return syscall(SYS_arch_prctl, ask, tile_data) == 0;
}
#else
bool may_use_amx() { return false; }
#endif

}  // namespace vsplat
