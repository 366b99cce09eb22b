#include "model/networks/params/config.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <utility>

#include "model/base/field_checks.h"
#include "model/networks/params/field_list.h"
#include "model/networks/params/params.h"
#include "runtime/fail.h"

namespace vsplat {

using json_fields::shown;

// The list of fields: calls visit(name, field) for each, in the header's order.
template <class C, class Visit>
static void each(C& c, Visit visit) {
  visit("image", c.image);
  visit("views", c.views);
  visit("use_views", c.use_views);
  visit("passes", c.passes);
  visit("merge_cell", c.merge_cell);
  visit("fit_epochs", c.fit_epochs);
  visit("patch", c.patch);
  visit("vit_dim", c.vit_dim);
  visit("vit_depth", c.vit_depth);
  visit("vit_heads", c.vit_heads);
  visit("vit_pos_grid", c.vit_pos_grid);
  visit("volume", c.volume);
  visit("volume_ch", c.volume_ch);
  visit("volume_mult", c.volume_mult);
  visit("voxel_ch", c.voxel_ch);
  visit("voxel_levels", c.voxel_levels);
  visit("fine_dim", c.fine_dim);
  visit("fine_count", c.fine_count);
  visit("sh_degree", c.sh_degree);
  visit("groups", c.groups);
  visit("levels", c.levels);
  visit("selection", c.selection);
  visit("opacity_threshold", c.opacity_threshold);
  visit("use_projected", c.use_projected);
  visit("view_weight", c.view_weight);
  visit("refine_out_kernel", c.refine_out_kernel);
  visit("sample_half_pixel", c.sample_half_pixel);
  visit("negate_camera_centre", c.negate_camera_centre);
  visit("rebase", c.rebase);
  visit("encoder", c.encoder);
  visit("vit_registers", c.vit_registers);
  visit("vit_norm_eps", c.vit_norm_eps);
  visit("vit_rope_base", c.vit_rope_base);
  visit("vit_rope_periods", c.vit_rope_periods);
  visit("vit_qkv_bias", c.vit_qkv_bias);
  visit("poses", c.poses);
  visit("share_dim", c.share_dim);
  visit("share_reduce", c.share_reduce);
  visit("share_splits", c.share_splits);
  visit("share_match_layers", c.share_match_layers);
  visit("share_match_mlp", c.share_match_mlp);
  visit("share_cross_mask", c.share_cross_mask);
  visit("share_pre_conv", c.share_pre_conv);
  visit("share_max_views", c.share_max_views);
  visit("share_view_dim", c.share_view_dim);
  visit("share_ray_dim", c.share_ray_dim);
  visit("share_ray_layers", c.share_ray_layers);
  visit("share_ray_heads", c.share_ray_heads);
  visit("share_ray_mlp", c.share_ray_mlp);
  visit("share_detach", c.share_detach);
  visit("share_loss_weight", c.share_loss_weight);
}
template <class Visit>
static void each_field(Config& c, Visit visit) {
  each(c, visit);
}
template <class Visit>
static void each_field(const Config& c, Visit visit) {
  each(c, visit);
}

namespace {

// Bounds beyond all sensible models, but small enough that products of a few of them fit 64 bits.
void check_bounds(const Config& c, const FieldChecks& is) {
  is.at_most("image", c.image, 2048);  // pictures of this size are allocated as floats before any planning
  is.at_most("patch", c.patch, 256);
  is.at_most("vit_dim", c.vit_dim, 16384);
  is.at_most("vit_depth", c.vit_depth, 256);
  is.at_most("vit_pos_grid", c.vit_pos_grid, 1024);
  is.at_most("volume", c.volume, 256);
  is.at_most("volume_ch", c.volume_ch, 4096);
  is.need(c.volume_mult.size() <= 8, "volume_mult must have at most 8 levels", c.volume_mult.size());
  is.at_most("volume_mult", *std::max_element(c.volume_mult.begin(), c.volume_mult.end()), 64);
  is.at_most("voxel_ch", c.voxel_ch, 16384);
  is.at_most("voxel_levels", c.voxel_levels, 64);
  is.at_most("fine_dim", c.fine_dim, 16384);
  is.at_most("fine_count", c.fine_count, 1024);
}

// Fields of components that this configuration does not have.
std::vector<std::string> without_meaning(const Config& c) {
  std::vector<std::string> out;
  if (c.encoder != "dinov3")
    out = {"encoder", "vit_registers", "vit_norm_eps", "vit_rope_base", "vit_rope_periods", "vit_qkv_bias"};
  if (!c.predicts_poses())
    out.insert(out.end(),
               {"poses", "share_dim", "share_reduce", "share_splits", "share_match_layers", "share_match_mlp",
                "share_cross_mask", "share_pre_conv", "share_max_views", "share_view_dim", "share_ray_dim",
                "share_ray_layers", "share_ray_heads", "share_ray_mlp", "share_detach", "share_loss_weight"});
  return out;
}

void check_predictor(const Config& c, const FieldChecks& is) {
  is.one_of("poses", c.poses, {"given", "predicted"});
  if (!c.predicts_poses()) return;
  is.need(c.share_reduce.size() == 2, "share_reduce must be two widths",
          fmt::format("[{}]", fmt::join(c.share_reduce, ", ")));
  const std::pair<const char*, int> sizes[] = {{"share_dim", c.share_dim},
                                               {"share_reduce", c.share_reduce[0]},
                                               {"share_reduce", c.share_reduce[1]},
                                               {"share_ray_dim", c.share_ray_dim}};
  for (const auto& [name, value] : sizes) is.within(name, value, 1, 16384);
  for (const int ch : {c.vit_dim, c.share_reduce[0], c.share_reduce[1]})
    is.need(ch % c.groups == 0, "vit_dim and share_reduce must be multiples of groups",
            fmt::format("{} and {}", ch, c.groups));
  is.need(c.share_dim % 4 == 0, "share_dim must be a multiple of 4: sine and cosine of y and x", c.share_dim);
  is.need(c.share_splits >= 1 && c.tokens() % c.share_splits == 0, "image / patch must be a multiple of share_splits",
          fmt::format("{} and {}", c.tokens(), c.share_splits));
  is.within("share_match_layers", c.share_match_layers, 1, 256);
  is.within("share_match_mlp", c.share_match_mlp, 1, 64);
  is.one_of("share_cross_mask", c.share_cross_mask, {"tiled", "aligned"});
  is.within("share_max_views", c.share_max_views, 2, 16);
  is.need(
      c.views >= 2 && c.views_to_use() >= 2 && c.views <= c.share_max_views && c.views_to_use() <= c.share_max_views,
      "views and use_views must be 2 to share_max_views where poses are predicted",
      fmt::format("{}, {} and {}", c.views, c.views_to_use(), c.share_max_views));
  is.within("share_view_dim", c.share_view_dim, 0, 1024);
  is.need(c.share_ray_heads >= 1 && c.share_ray_dim % 2 == 0 && c.share_ray_dim % c.share_ray_heads == 0,
          "share_ray_dim must be even and a multiple of share_ray_heads",
          fmt::format("{} and {}", c.share_ray_dim, c.share_ray_heads));
  is.within("share_ray_layers", c.share_ray_layers, 1, 256);
  is.need(c.share_ray_mlp * c.share_ray_dim >= 1 && c.share_ray_mlp <= 64,
          "share_ray_mlp must make an MLP at least 1 wide, and be at most 64", c.share_ray_mlp);
  is.need(c.share_loss_weight >= 0 && c.share_loss_weight <= 1e6, "share_loss_weight must be 0 to 1e6",
          c.share_loss_weight);
}

void check_encoder(const Config& c, const FieldChecks& is) {
  is.one_of("encoder", c.encoder, {"dino", "dinov3"});
  if (c.encoder != "dinov3") return;
  is.need(c.vit_dim % (4L * c.vit_heads) == 0,
          "vit_dim must be a multiple of 4 vit_heads: half of a head turns with y, half with x, in pairs",
          fmt::format("{} and {}", c.vit_dim, c.vit_heads));
  is.need(c.vit_registers >= 0 && c.vit_registers <= 64, "vit_registers must be 0 to 64", c.vit_registers);
  is.need(c.vit_norm_eps > 0 && c.vit_norm_eps < 1, "vit_norm_eps must be in (0,1)", c.vit_norm_eps);
  is.need(c.vit_rope_base >= 1 && c.vit_rope_base <= 1e9, "vit_rope_base must be 1 to 1e9", c.vit_rope_base);
  is.one_of("vit_rope_periods", c.vit_rope_periods, {"exact", "bf16"});
}

void check_sizes(const Config& c, const FieldChecks& is) {
  const double tokens = static_cast<double>(c.tokens()) * c.tokens() + c.encoder_sizes().prefix();
  is.indexable("the encoder's values for 16 views, 16 (tokens + 1) 4 vit_dim,", 16 * tokens * 4 * c.vit_dim);
  const double voxels = static_cast<double>(c.voxels());
  const double widest = std::max(4, 2 * *std::max_element(c.volume_mult.begin(), c.volume_mult.end()));
  is.indexable("the volume's values, volume^3 x the widest layer,", voxels * widest * c.volume_ch);
  is.indexable("the Gaussians, volume^3 (fine_count + 1),", voxels * (c.fine_count + 1));
  for (const Parameter& parameter : parameters(c)) {
    double elements = 1;
    for (const long n : parameter.shape) elements *= static_cast<double>(n);
    is.indexable(("the elements of " + parameter.name).c_str(), elements);
  }
}

}  // namespace

const std::vector<std::string>& config_names() {
  static const std::vector<std::string> names = {"paper", "small", "tiny", "micro"};
  return names;
}

Config named_config(const std::string& name) {
  Config c;
  if (name == "paper") return c;
  if (name == "small") {
    c.image = 128, c.patch = 8, c.vit_dim = 384, c.vit_depth = 4, c.vit_heads = 6, c.vit_pos_grid = 16;
    c.volume = 32, c.volume_ch = 64, c.voxel_ch = 128, c.voxel_levels = 1, c.fine_dim = 256, c.fine_count = 8;
    c.groups = 16;
  } else if (name == "tiny") {  // sizes that reveal a transposed axis or a hard-coded size
    c.image = 48, c.views = 3, c.patch = 8, c.vit_dim = 24, c.vit_depth = 2, c.vit_heads = 3, c.vit_pos_grid = 4;
    c.volume = 10, c.volume_ch = 16, c.voxel_ch = 24, c.voxel_levels = 2, c.fine_dim = 32, c.fine_count = 3;
    c.groups = 8;
  } else if (name == "micro") {  // for interpreters: every component, at minimal size
    c.image = 16, c.views = 2, c.patch = 8, c.vit_dim = 12, c.vit_depth = 1, c.vit_heads = 2, c.vit_pos_grid = 3;
    c.volume = 4, c.volume_ch = 4, c.voxel_ch = 8, c.voxel_levels = 1, c.fine_dim = 8, c.fine_count = 2;
    c.groups = 2;
  } else {
    fail(Status::usage, "no configuration is called {}; there are {}", shown(name), fmt::join(config_names(), ", "));
  }
  return c;
}

void check(const Config& c, Status status) {
  const FieldChecks is(status);
  const std::pair<const char*, int> positive[] = {{"image", c.image},         {"patch", c.patch},
                                                  {"vit_dim", c.vit_dim},     {"vit_depth", c.vit_depth},
                                                  {"vit_heads", c.vit_heads}, {"vit_pos_grid", c.vit_pos_grid},
                                                  {"volume", c.volume},       {"volume_ch", c.volume_ch},
                                                  {"voxel_ch", c.voxel_ch},   {"voxel_levels", c.voxel_levels},
                                                  {"fine_dim", c.fine_dim},   {"groups", c.groups}};
  for (const auto& [name, value] : positive) is.need(value >= 1, fmt::format("{} must be at least 1", name), value);
  is.need(c.image >= 11, "image must be at least 11, SSIM's window", c.image);
  is.need(!c.volume_mult.empty() && *std::min_element(c.volume_mult.begin(), c.volume_mult.end()) >= 1,
          "volume_mult must be positive", fmt::format("[{}]", fmt::join(c.volume_mult, ", ")));
  is.need(c.opacity_threshold >= 0 && c.opacity_threshold < 1, "opacity_threshold must be in [0,1)",
          c.opacity_threshold);
  is.need(c.fine_count >= 1, "fine_count must be at least 1", c.fine_count);
  check_bounds(c, is);

  is.need(c.image % c.patch == 0, "image must be a multiple of patch", fmt::format("{} and {}", c.image, c.patch));
  is.need(c.vit_dim % c.vit_heads == 0, "vit_dim must be a multiple of vit_heads",
          fmt::format("{} and {}", c.vit_dim, c.vit_heads));
  is.need(c.volume % (1 << (c.volume_mult.size() - 1)) == 0,
          "volume must be divisible by 2 for every level of volume_mult but one",
          fmt::format("{} and {} levels", c.volume, c.volume_mult.size()));
  const std::pair<const char*, int> grouped[] = {
      {"volume_ch", c.volume_ch}, {"voxel_ch", c.voxel_ch}, {"voxel_ch + vit_dim", c.voxel_ch + c.projected_ch()}};
  for (const auto& [name, channels] : grouped)
    is.need(channels % c.groups == 0, fmt::format("{} must be a multiple of groups", name),
            fmt::format("{} and {}", channels, c.groups));
  is.need(c.sh_degree >= 0 && c.sh_degree <= 3, "sh_degree must be 0 to 3", c.sh_degree);
  is.need(c.views >= 1 && c.views <= 16, "views must be 1 to 16", c.views);
  is.need(c.use_views >= 0 && c.use_views <= 16, "use_views must be 0, for as many as views, to 16", c.use_views);
  is.need(c.passes >= 1 && c.passes <= 16, "passes must be 1 to 16", c.passes);
  is.need(c.passes == 1 || c.rebase == "rotate", "passes must be 1 unless rebase is rotate", c.passes);
  is.need(c.merge_cell >= 0 && c.merge_cell <= 16, "merge_cell must be 0, for none, to 16", c.merge_cell);
  is.need(c.fit_epochs >= 0 && c.fit_epochs <= 1000, "fit_epochs must be 0, for none, to 1000", c.fit_epochs);
  is.need(c.refine_out_kernel == 1 || c.refine_out_kernel == 3, "refine_out_kernel must be 1 or 3",
          c.refine_out_kernel);
  is.one_of("levels", c.levels, {"fine", "skeletal", "coarse"});
  is.one_of("selection", c.selection, {"gumbel", "sigmoid", "ste", "opacity"});
  is.one_of("view_weight", c.view_weight, {"depth", "distance"});
  is.one_of("rebase", c.rebase, {"rotate", "move"});
  check_encoder(c, is);
  check_predictor(c, is);
  check_sizes(c, is);
}

void set_field(Config& config, const std::string& assignment) { field_list::set(config, assignment); }

Config with_fields(Config config, const std::vector<std::string>& assignments) {
  for (const std::string& assignment : assignments) set_field(config, assignment);
  check(config);
  return config;
}

std::string to_json(const Config& config) {
  nlohmann::ordered_json out = field_list::object_of(config);
  // Omits newer fields with default values, so that files do not change and older versions can read them.
  for (const char* field : {"use_views", "passes", "merge_cell", "fit_epochs"})
    if (differing_fields(config, Config(), {field}).empty()) out.erase(field);
  for (const std::string& field : without_meaning(config))
    if (differing_fields(config, Config(), {field}).empty()) out.erase(field);
  return field_list::text_of(out);
}

std::vector<std::string> set_fields_from_json(Config& config, const std::string& text) {
  return field_list::set_from_json(config, text);
}

Config config_from_json(const std::string& text, const Config& base) {
  Config config = base;
  set_fields_from_json(config, text);
  check(config, Status::format);
  return config;
}

std::string field_text(const Config& config, const std::string& field) { return field_list::field_text(config, field); }

std::vector<std::string> differing_fields(const Config& a, const Config& b, const std::vector<std::string>& fields) {
  return field_list::differing(a, b, fields);
}

}  // namespace vsplat
