// Random colours and textures.
#pragma once
#include <cstddef>
#include <string>
#include <vector>

#include "model/data/byte_cache.h"
#include "model/data/mesh.h"
#include "model/data/random.h"

namespace vsplat {

// A pattern of checks, stripes, spots or clouds in two random colours, with 128 texels to a side.
std::shared_ptr<const Texture> random_texture(Random& random);

// The pictures of a folder as textures, sorted by name. Thread-safe.
class TextureFolder {
 public:
  // Error(file) if there is no such folder, Error(input) if it contains no picture.
  explicit TextureFolder(const std::string& path);

  std::size_t count() const { return files_.size(); }
  // The texture, with its longer side reduced to at most 512 texels. Error(file or format) as read_image().
  std::shared_ptr<const Texture> at(std::size_t index) const;

 private:
  std::vector<std::string> files_;
  mutable ByteCache<std::size_t, Texture> kept_;
};

// The colouring of a part.
struct Paint {
  Material material;
  // With `gradient`, corner colours vary along `along` (of unit length) from `colours[0]` at one end of the part over
  // [1] in the middle to [2] at the other end, in linear light; without it corners are white.
  bool gradient = false;
  Eigen::Vector3f colours[3];
  Eigen::Vector3f along = Eigen::Vector3f::UnitY();
  // Repetitions of the texture across the part, and its offset.
  Eigen::Vector2f repeats = Eigen::Vector2f::Ones(), begins = Eigen::Vector2f::Zero();
};

// The gradient's linear colour at 0 (one end) over 1 (middle) to 2 (other end); constant beyond the ends.
Eigen::Vector3f gradient_colour(const Paint& paint, float at);

// A single colour, a gradient, a pattern, or one of `textures` (may be null: none); half of the parts use `textures`.
Paint random_paint(Random& random, const TextureFolder* textures);

// Colours triangles whose texture coordinates are in [0,1].
void apply(const Paint& paint, std::vector<Corner>& corners);

}  // namespace vsplat
