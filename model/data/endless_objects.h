// Random objects in the form of a data set's objects, rendered on demand: no file is read or written.
#pragma once
#include <cstdint>

#include "model/data/framed_object.h"
#include "model/data/paints.h"

namespace vsplat {

// Decides which items of a training are random objects for a given share; spreads them as evenly as possible, by item
// number only.
class EndlessShare {
 public:
  explicit EndlessShare(double share) : share_(share) {}
  bool is_random(std::uint64_t item) const { return before(item + 1) > before(item); }
  // The number of non-random items before this one.
  std::uint64_t others_before(std::uint64_t item) const { return item - before(item); }

 private:
  std::uint64_t before(std::uint64_t item) const {
    return static_cast<std::uint64_t>(static_cast<double>(item) * share_);
  }
  double share_;
};

// random_object(seed, index) as `dataset procedural` would write it, with `views` views of `size` pixels. A view is
// rendered by one thread when its picture is requested. Thread-safe.
FramedObject endless_object(std::uint64_t seed, std::uint32_t index, int views, int size,
                            const TextureFolder* textures);

}  // namespace vsplat
