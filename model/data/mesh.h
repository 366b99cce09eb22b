// A textured triangle mesh in host memory, as data sets are drawn from.
#pragma once
#include <Eigen/Core>
#include <cstdint>
#include <memory>
#include <string>
#include <vector>

namespace vsplat {

// 8-bit sRGB, [height][width][3], the upper row first.
struct Texture {
  int width = 0, height = 0;
  std::vector<unsigned char> rgb;
  std::vector<unsigned char> alpha;  // [height][width], or none: 255 everywhere
};

// What a texture is beyond its edges, and between its texels.
enum class Beyond { repeat, clamp, mirror };
struct Sampling {
  Beyond u = Beyond::repeat, v = Beyond::repeat;
  bool nearest = false;  // the nearest texel, where others are interpolated
};

// The colour of a surface is light x colour x corners' colour x texture + emission x its texture, in linear light.
// Where alpha x corners' alpha x the texture's alpha is below `cutoff` there is no surface; elsewhere it is opaque.
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
  Eigen::Vector3f normal = Eigen::Vector3f::Zero();  // unit length, or zero where not known yet
  Eigen::Vector3f colour = Eigen::Vector3f::Ones();  // linear
  float alpha = 1;
  Eigen::Vector2f uv = Eigen::Vector2f::Zero();           // (0,0) is the texture's lower left
  Eigen::Vector2f emission_uv = Eigen::Vector2f::Zero();  // of the emission's texture
};

struct Mesh {
  std::string name;                      // for messages: the file
  std::vector<Corner> corners;           // three a triangle
  std::vector<std::uint32_t> materials;  // one a triangle, into `palette`
  std::vector<Material> palette;

  std::size_t triangles() const { return materials.size(); }
};

// A picture (three or four channels) as texture.
struct Image;
class PixelRows;
std::shared_ptr<const Texture> texture_of(const Image& picture);
std::shared_ptr<const Texture> texture_of(PixelRows& picture);

// The colour at `uv`, bilinear between texels' centres, in linear light.
Eigen::Vector3f sample(const Texture& texture, const Eigen::Vector2f& uv, const Sampling& sampling = {});
// The alpha there, 0 to 1.
float sample_alpha(const Texture& texture, const Eigen::Vector2f& uv, const Sampling& sampling = {});

// Gives corners without a normal the mean of the faces' normals about their position, by area, of those faces that
// differ from their own by less than 45 degrees: edges stay edges. Positions are finite.
void compute_normals(Mesh& mesh);

// Moves and scales the mesh so that its bounding box is centred at the origin and its longest edge is 1, within
// [-0.5,0.5]^3. Error(input) where there is no triangle, a coordinate is not finite, or the mesh has no extent.
void fit_into_cube(Mesh& mesh);

// The distance of the farthest corner from the origin.
double radius_of(const Mesh& mesh);

}  // namespace vsplat
