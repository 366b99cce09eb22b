// The configuration of LaRa's network (and, with other values, of GenDen's backbone): sizes and choices. The defaults
// are the published sizes.
#pragma once
#include <string>
#include <vector>

#include "model/base/taken_views.h"
#include "model/networks/params/config_fields.h"
#include "runtime/error.h"

namespace vsplat {

struct LaraConfig {
  int image = 512;  // input and rendering resolution, square, pixels
  int views = 4;    // number of views in training; the network takes 1 to view_slots
  int patch = 16;
  int vit_dim = 768;
  int vit_depth = 12;
  int vit_heads = 12;
  int vit_pos_grid = 14;    // side of the stored position embedding
  int feature_volume = 16;  // side of the grid that each picture is lifted to
  int volume = 32;          // side of the transformer's grid; the primitives' grid has twice that
  std::vector<int> windows = {
      16};  // cells along an axis of the attention's windows; layer i takes windows[i mod count]
  int volume_ch = 256;
  int layers = 12;
  int heads = 16;
  int view_slots = 4;           // views that have an embedding
  int view_ch = 32;             // width of the learned embedding of a view's number
  int out_ch = 80;              // width of the upsampled volume and of the decoders
  int primitives = 2;           // K per voxel
  std::string kind = "surfel";  // surfel: 2 scales; gaussian: 3
  int offset_cells = 32;        // a primitive stays within 0.25 / offset_cells of its voxel's centre on each axis
  int fine_heads = 8;
  int fine_hidden = 64;
  int fine_features = 0;  // features that the fine decoder returns besides colours (GenDen)
  int sh_degree = 1;
  double opacity_threshold = 0.005;
  bool sample_half_pixel = true;
  bool negate_camera_centre = true;
  std::string revision = "lara";  // of the surfels' rasteriser: lara, current
  std::string rebase = "move";    // rotate, move: as in its training

  int tokens() const { return encoder_sizes().tokens(); }
  TakenViews taken() const { return {image, views, views, view_slots, rebase, 1, 0, grid()}; }
  EncoderSizes encoder_sizes() const { return {image, patch, vit_dim, vit_depth, vit_heads, vit_pos_grid}; }
  int sh_count() const { return (sh_degree + 1) * (sh_degree + 1); }
  int scales() const { return kind == "surfel" ? 2 : 3; }
  int primitive_size() const { return 8 + 3 * sh_count() + scales(); }  // offset, SH, opacity, scale, rotation
  int grid() const { return 2 * volume; }                               // side of the primitives' grid
  int lifted_ch() const { return vit_dim + view_ch; }
  long voxels() const { return static_cast<long>(volume) * volume * volume; }
  long lifted_voxels() const { return static_cast<long>(feature_volume) * feature_volume * feature_volume; }
  long most_primitives() const { return 8 * voxels() * primitives; }
  // As in AnyConfig.
  long selectable() const { return most_primitives(); }
  long noise() const { return 0; }
  bool has_fine() const { return true; }
  bool has_surfels() const { return kind == "surfel"; }

  bool operator==(const LaraConfig&) const = default;
};

// published, small (what two CPU cores train), tiny and micro (for tests), in this order.
const std::vector<std::string>& lara_config_names();
LaraConfig named_lara_config(const std::string& name);  // Error(usage) that lists the names

// As in config.h for VS-Splat's.
void check(const LaraConfig& config, Status status = Status::usage);
void set_field(LaraConfig& config, const std::string& assignment);
std::string to_json(const LaraConfig& config);
LaraConfig lara_config_from_json(const std::string& text, const LaraConfig& base = {});
std::vector<std::string> set_fields_from_json(LaraConfig& config, const std::string& text);
std::string field_text(const LaraConfig& config, const std::string& field);
std::vector<std::string> differing_fields(const LaraConfig& a, const LaraConfig& b,
                                          const std::vector<std::string>& fields);

}  // namespace vsplat
