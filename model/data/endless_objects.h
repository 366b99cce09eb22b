// Random objects as those of a data set, drawn when they are asked for: nothing is read or written.
#pragma once
#include <cstdint>

#include "model/data/framed_object.h"
#include "model/data/paints.h"

namespace vsplat {

// Which items of a training are random objects, where a share of them is: spread as evenly as can be, by number alone.
class EndlessShare {
 public:
  explicit EndlessShare(double share) : share_(share) {}
  bool is_random(std::uint64_t item) const { return before(item + 1) > before(item); }
  // Of the other items, how many come before this one.
  std::uint64_t others_before(std::uint64_t item) const { return item - before(item); }

 private:
  std::uint64_t before(std::uint64_t item) const {
    return static_cast<std::uint64_t>(static_cast<double>(item) * share_);
  }
  double share_;
};

// random_object(seed, index) as `dataset procedural` would write it with so many views of `size` pixels; a view is
// drawn, by one thread, when its picture is asked for. May be used by several threads.
FramedObject endless_object(std::uint64_t seed, std::uint32_t index, int views, int size,
                            const TextureFolder* textures);

}  // namespace vsplat
