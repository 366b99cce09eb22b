// One model: its sizes, and the choices in which the paper, the published code and the paper's ablations differ.
// The defaults are the paper's sizes with the published code's choices.
#pragma once
#include <string>
#include <vector>

namespace vsplat {

// Of the image encoder, which all networks have.
struct EncoderSizes {
  int image = 512, patch = 16;
  int vit_dim = 768, vit_depth = 12, vit_heads = 12;
  int vit_pos_grid = 14;

  int tokens() const { return image / patch; }  // along an edge
};

// Of the pictures that a network takes.
struct TakenViews {
  int image;           // edge in pixels
  int trained;         // how many views it is trained and measured with
  int usual;           // how many a reconstruction picks where more are there
  int most;            // more are refused
  std::string rebase;  // rotate, move
};

struct Config {
  int image = 512;  // input and render resolution, square, pixels
  int views = 4;    // how many views it is trained and measured with; the network takes 1 to 16
  // How many views a reconstruction picks where more are there, as the model's makers measured; 0: `views`.
  int use_views = 0;
  int patch = 16;
  int vit_dim = 768;
  int vit_depth = 12;
  int vit_heads = 12;
  int vit_pos_grid = 14;  // side of the stored position embedding
  int volume = 48;        // R, voxels along an edge
  int volume_ch = 128;    // C~, also the U-Net's width
  std::vector<int> volume_mult = {1, 2};
  int voxel_ch = 256;    // width of the refinement's sparse blocks
  int voxel_levels = 2;  // each with two residual blocks
  int fine_dim = 512;
  int fine_count = 16;  // M
  int sh_degree = 1;
  int groups = 32;                   // of every GroupNorm
  std::string levels = "fine";       // fine, skeletal, coarse
  std::string selection = "gumbel";  // gumbel, sigmoid, ste, opacity
  double opacity_threshold = 0.005;  // of selection "opacity"
  bool use_projected = true;
  std::string view_weight = "depth";  // depth, distance
  int refine_out_kernel = 1;          // 1, 3
  bool sample_half_pixel = true;
  bool negate_camera_centre = false;
  std::string rebase = "rotate";  // rotate, move

  int views_to_use() const { return use_views > 0 ? use_views : views; }
  TakenViews taken() const { return {image, views, views_to_use(), 16, rebase}; }
  int sh_count() const { return (sh_degree + 1) * (sh_degree + 1); }
  int tokens() const { return encoder().tokens(); }  // along an edge
  EncoderSizes encoder() const { return {image, patch, vit_dim, vit_depth, vit_heads, vit_pos_grid}; }
  int primitive_size() const { return 3 + 3 * sh_count() + 1 + 3 + 4; }  // offset, SH, opacity, scale, rotation
  int projected_ch() const { return use_projected ? vit_dim : 0; }
  long voxels() const { return static_cast<long>(volume) * volume * volume; }

  bool operator==(const Config&) const = default;
};

}  // namespace vsplat
