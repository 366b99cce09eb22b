#include "runtime/launch.h"

#include "runtime/rounding.h"

namespace vsplat {

Range items(long n, long local) {
  return {{static_cast<std::size_t>(round_up(n, local)), 1, 1}, {static_cast<std::size_t>(local), 1, 1}};
}

Range groups(long n, long local, long n2, long n3) {
  return {{static_cast<std::size_t>(n * local), static_cast<std::size_t>(n2), static_cast<std::size_t>(n3)},
          {static_cast<std::size_t>(local), 1, 1}};
}

}  // namespace vsplat
