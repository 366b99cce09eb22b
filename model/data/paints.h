// Colours and textures by chance.
#pragma once
#include <cstddef>
#include <string>
#include <vector>

#include "model/data/byte_cache.h"
#include "model/data/mesh.h"
#include "model/data/random.h"

namespace vsplat {

// Checks, stripes, spots or clouds of two random colours, 128 texels to a side.
std::shared_ptr<const Texture> random_texture(Random& random);

// The pictures of a folder as textures, in order of name. May be used by several threads.
class TextureFolder {
 public:
  // Error(file) where there is no such folder, Error(input) where no picture is in it.
  explicit TextureFolder(const std::string& path);

  std::size_t count() const { return files_.size(); }
  // Its longer side made 512 texels where it is longer. Error(file or format) as read_image() has them.
  std::shared_ptr<const Texture> at(std::size_t index) const;

 private:
  std::vector<std::string> files_;
  mutable ByteCache<std::size_t, Texture> kept_;
};

// How a part is coloured.
struct Paint {
  Material material;
  // Corners are of a colour that goes from `colours[0]` at the part's one end along `along` (of unit length) over [1]
  // in the middle to [2] at the other, linear; without `gradient` they are white.
  bool gradient = false;
  Eigen::Vector3f colours[3];
  Eigen::Vector3f along = Eigen::Vector3f::UnitY();
  // The texture is repeated so often across the part, and begins so far in.
  Eigen::Vector2f repeats = Eigen::Vector2f::Ones(), begins = Eigen::Vector2f::Zero();
};

// The gradient's colour, linear, from 0 at the one end over 1 in the middle to 2 at the other; the ends go on beyond.
Eigen::Vector3f gradient_colour(const Paint& paint, float at);

// One colour, a gradient, a pattern, or one of `textures` (may be null: none), these for half of the parts.
Paint random_paint(Random& random, const TextureFolder* textures);

// Colours triangles, whose texture coordinates are in [0,1].
void apply(const Paint& paint, std::vector<Corner>& corners);

}  // namespace vsplat
