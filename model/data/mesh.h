// A textured triangle mesh in host memory, used to render data sets.
#pragma once
#include <Eigen/Core>
#include <cstdint>
#include <memory>
#include <string>
#include <vector>

namespace vsplat {

// 8-bit sRGB, [height][width][3], top row first.
struct Texture {
  int width = 0, height = 0;
  std::vector<unsigned char> rgb;
  std::vector<unsigned char> alpha;  // [height][width], or empty: 255 everywhere
};

// The extension of a texture beyond its edges, and its interpolation.
enum class Beyond { repeat, clamp, mirror };
struct Sampling {
  Beyond u = Beyond::repeat, v = Beyond::repeat;
  bool nearest = false;  // the nearest texel instead of interpolation
};

// A surface's colour is light x colour x corner colour x texture + emission x emission texture, in linear light. Where
// alpha x corner alpha x texture alpha is below `cutoff`, there is no surface; elsewhere it is opaque.
struct Material {
  Eigen::Vector3f colour = Eigen::Vector3f::Ones();
  std::shared_ptr<const Texture> texture = nullptr;
  float alpha = 1, cutoff = 0;
  Sampling sampling = {};
  Eigen::Vector3f emission = Eigen::Vector3f::Zero();
  std::shared_ptr<const Texture> emission_texture = nullptr;
  Sampling emission_sampling = {};
};

struct Corner {
  Eigen::Vector3f position = Eigen::Vector3f::Zero();
  Eigen::Vector3f normal = Eigen::Vector3f::Zero();  // unit length, or zero if not yet known
  Eigen::Vector3f colour = Eigen::Vector3f::Ones();  // linear
  float alpha = 1;
  Eigen::Vector2f uv = Eigen::Vector2f::Zero();           // (0,0) is the texture's lower left
  Eigen::Vector2f emission_uv = Eigen::Vector2f::Zero();  // for the emission texture
};

struct Mesh {
  std::string name;                      // for messages: the file
  std::vector<Corner> corners;           // three per triangle
  std::vector<std::uint32_t> materials;  // one per triangle, index into `palette`
  std::vector<Material> palette;

  std::size_t triangles() const { return materials.size(); }
};

// A surface with its normals and colours.
struct SurfaceMesh;
Mesh with_corners(const SurfaceMesh& surface);

// Converts a picture (three or four channels) to a texture.
struct Image;
class PixelRows;
std::shared_ptr<const Texture> texture_of(const Image& picture);
std::shared_ptr<const Texture> texture_of(PixelRows& picture);

// The colour at `uv`, bilinear between texel centres, in linear light.
Eigen::Vector3f sample(const Texture& texture, const Eigen::Vector2f& uv, const Sampling& sampling = {});
// The alpha at `uv`, 0 to 1.
float sample_alpha(const Texture& texture, const Eigen::Vector2f& uv, const Sampling& sampling = {});

// Sets missing normals of corners to the area-weighted mean of the normals of the faces at their position, using only
// faces that differ from the corner's own face by less than 45 degrees, so that edges stay sharp. Positions must be
// finite.
void compute_normals(Mesh& mesh);

// Moves and scales the mesh so that its bounding box is centred at the origin with a longest edge of 1, within
// [-0.5,0.5]^3. Error(input) if there is no triangle, a coordinate is not finite, or the mesh has no extent.
void fit_into_cube(Mesh& mesh);

// The distance of the farthest corner from the origin.
double radius_of(const Mesh& mesh);

}  // namespace vsplat
