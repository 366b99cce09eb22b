// A model's sizes, and the choices in which the paper, the published code and the paper's ablations differ. The
// defaults are the paper's sizes with the published code's choices.
#pragma once
#include <string>
#include <vector>

#include "model/base/taken_views.h"

namespace vsplat {

// Sizes of the image encoder, which all architectures have.
struct EncoderSizes {
  int image = 512, patch = 16;
  int vit_dim = 768, vit_depth = 12, vit_heads = 12;
  int vit_pos_grid = 14;
  bool dinov3 = false;  // kind of vision transformer; the fields below only apply to DINOv3
  int registers = 0;
  double norm_eps = 1e-6, rope_base = 100;
  bool rope_bf16 = false, qkv_bias = true;

  int tokens() const { return image / patch; }  // along an edge
  int prefix() const { return 1 + registers; }  // tokens that are not patches: they come first, and are dropped
};

struct Config {
  int image = 512;  // input and render resolution, square, pixels
  int views = 4;    // number of views in training and evaluation; the network takes 1 to 16
  // Views that a reconstruction picks if more are available, as measured by the model's authors; 0: `views`.
  int use_views = 0;
  // Forward passes of a reconstruction, each with another view as the reference; 1 to 16. Their Gaussians are joined.
  int passes = 1;
  double merge_cell = 0;  // in voxels: a reconstruction's Gaussians that share a cell of this edge become one; 0: none
  int fit_epochs = 0;     // epochs of the fit of those Gaussians to the inputs that follows; 0 to 1000
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
  int groups = 32;                   // in every GroupNorm
  std::string levels = "fine";       // fine, skeletal, coarse
  std::string selection = "gumbel";  // gumbel, sigmoid, ste, opacity
  double opacity_threshold = 0.005;  // for selection "opacity"
  bool use_projected = true;
  std::string view_weight = "depth";  // depth, distance
  int refine_out_kernel = 1;          // 1, 3
  bool sample_half_pixel = true;
  bool negate_camera_centre = false;
  std::string rebase = "rotate";  // rotate, move

  // dino: DINO's vision transformer; dinov3: DINOv3's, with the fields below (vit_pos_grid is then unused).
  std::string encoder = "dino";
  int vit_registers = 4;
  double vit_norm_eps = 1e-5;
  double vit_rope_base = 100;
  std::string vit_rope_periods = "exact";  // exact: as computed; bf16: rounded, as in Meta's files
  bool vit_qkv_bias = false;               // biases of queries and values

  // Source of the rays that tokens are conditioned on. given: the cameras; predicted: maps that a network predicts from
  // the features, with the fields below.
  std::string poses = "given";
  int share_dim = 128;                         // width of the matching transformer
  std::vector<int> share_reduce = {512, 256};  // widths of the three convolutions before it; the last has share_dim
  int share_splits = 2;                        // windows along each side of the token grid
  int share_match_layers = 6;
  int share_match_mlp = 4;                 // the MLP's width is this x 2 share_dim
  std::string share_cross_mask = "tiled";  // tiled: as in SHARE's code; aligned: by the keys, as intended
  bool share_pre_conv = true;
  int share_max_views = 4;  // limit on views, since it has a code for each
  int share_view_dim = 8;   // width of a view's code; 0: none
  int share_ray_dim = 256;
  int share_ray_layers = 8;
  int share_ray_heads = 8;
  double share_ray_mlp = 4;      // the MLP's width is this x share_ray_dim
  bool share_detach = false;     // no gradient flows from the predictor to the encoder
  double share_loss_weight = 1;  // weight of the maps' mean squared error in the training loss

  int views_to_use() const { return use_views > 0 ? use_views : views; }
  bool predicts_poses() const { return poses == "predicted"; }
  int most_views() const { return predicts_poses() ? share_max_views : 16; }
  TakenViews taken() const {
    return {image, views, views_to_use(), most_views(), rebase, passes, merge_cell, volume, fit_epochs};
  }
  int sh_count() const { return (sh_degree + 1) * (sh_degree + 1); }
  int tokens() const { return encoder_sizes().tokens(); }  // along an edge
  EncoderSizes encoder_sizes() const {
    EncoderSizes out{image, patch, vit_dim, vit_depth, vit_heads, vit_pos_grid};
    if (encoder != "dinov3") return out;
    out.dinov3 = true, out.registers = vit_registers, out.norm_eps = vit_norm_eps, out.rope_base = vit_rope_base;
    out.rope_bf16 = vit_rope_periods == "bf16", out.qkv_bias = vit_qkv_bias;
    return out;
  }
  int primitive_size() const { return 3 + 3 * sh_count() + 1 + 3 + 4; }  // offset, SH, opacity, scale, rotation
  int projected_ch() const { return use_projected ? vit_dim : 0; }
  long voxels() const { return static_cast<long>(volume) * volume * volume; }
  // As in AnyConfig.
  long selectable() const { return voxels(); }
  long noise() const { return voxels(); }
  bool has_fine() const { return levels != "coarse"; }
  bool has_surfels() const { return false; }

  bool operator==(const Config&) const = default;
};

}  // namespace vsplat
