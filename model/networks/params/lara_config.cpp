#include "model/networks/params/lara_config.h"

#include <fmt/ranges.h>

#include <algorithm>
#include <utility>

#include "model/base/field_checks.h"
#include "model/networks/params/field_list.h"
#include "model/networks/params/lara_fields.h"
#include "model/networks/params/params.h"

namespace vsplat {

template <class Visit>
static void each_field(LaraConfig& c, Visit visit) {
  each_lara_field(c, visit);
}
template <class Visit>
static void each_field(const LaraConfig& c, Visit visit) {
  each_lara_field(c, visit);
}

namespace {

// Bounds beyond all sensible models, but small enough that products of a few of them fit 64 bits.
void check_bounds(const LaraConfig& c, const FieldChecks& is) {
  const std::tuple<const char*, int, int> bounds[] = {{"image", c.image, 2048},
                                                      {"patch", c.patch, 256},
                                                      {"vit_dim", c.vit_dim, 16384},
                                                      {"vit_depth", c.vit_depth, 256},
                                                      {"vit_heads", c.vit_heads, 16384},
                                                      {"vit_pos_grid", c.vit_pos_grid, 1024},
                                                      {"feature_volume", c.feature_volume, 128},
                                                      {"volume", c.volume, 128},
                                                      {"volume_ch", c.volume_ch, 4096},
                                                      {"layers", c.layers, 256},
                                                      {"heads", c.heads, 4096},
                                                      {"view_slots", c.view_slots, 16},
                                                      {"view_ch", c.view_ch, 4096},
                                                      {"out_ch", c.out_ch, 4096},
                                                      {"primitives", c.primitives, 64},
                                                      {"offset_cells", c.offset_cells, 1 << 20},
                                                      {"fine_heads", c.fine_heads, 4096},
                                                      {"fine_hidden", c.fine_hidden, 16384}};
  for (const auto& [name, value, most] : bounds) is.within(name, value, 1, most);
  is.within("fine_features", c.fine_features, 0, 4096);
  is.within("sh_degree", c.sh_degree, 0, 3);
}

void check_sizes(const LaraConfig& c, const FieldChecks& is) {
  const double tokens = static_cast<double>(c.tokens()) * c.tokens() + 1, voxels = static_cast<double>(c.voxels());
  is.indexable("the encoder's values, view_slots (tokens + 1) 4 vit_dim,", c.view_slots * tokens * 4 * c.vit_dim);
  is.indexable("the lifted values, feature_volume^3 view_slots (vit_dim + view_ch),",
               static_cast<double>(c.lifted_voxels()) * c.view_slots * c.lifted_ch());
  is.indexable("the volume's values, volume^3 2 volume_ch,", voxels * 2 * c.volume_ch);
  is.indexable("the primitives' numbers,", 8 * voxels * c.primitives * c.primitive_size());
  is.indexable("the decoder's values, (2 volume)^3 out_ch,", 8 * voxels * c.out_ch);
  for (const Parameter& parameter : parameters(c)) {
    double elements = 1;
    for (const long n : parameter.shape) elements *= static_cast<double>(n);
    is.indexable(("the elements of " + parameter.name).c_str(), elements);
  }
}

}  // namespace

const std::vector<std::string>& lara_config_names() {
  static const std::vector<std::string> names = {"published", "small", "tiny", "micro"};
  return names;
}

LaraConfig named_lara_config(const std::string& name) {
  LaraConfig c;
  if (name == "published") return c;
  if (name == "small") {
    c.image = 128, c.patch = 8, c.vit_dim = 384, c.vit_depth = 4, c.vit_heads = 6, c.vit_pos_grid = 16;
    c.feature_volume = 16, c.volume = 16, c.volume_ch = 64, c.layers = 6, c.heads = 4, c.view_ch = 16;
    c.out_ch = 32, c.offset_cells = 16, c.fine_heads = 4, c.fine_hidden = 32;
  } else if (name == "tiny") {  // sizes that reveal a transposed axis or a hard-coded size
    c.image = 24, c.views = 3, c.patch = 4, c.vit_dim = 24, c.vit_depth = 2, c.vit_heads = 3, c.vit_pos_grid = 4;
    c.feature_volume = 3, c.volume = 6, c.windows = {3}, c.volume_ch = 16, c.layers = 3, c.heads = 4;
    c.view_ch = 4, c.out_ch = 12, c.offset_cells = 5, c.fine_heads = 2, c.fine_hidden = 10;
  } else if (name == "micro") {  // for interpreters: every component, at minimal size
    c.image = 12, c.views = 2, c.patch = 4, c.vit_dim = 12, c.vit_depth = 1, c.vit_heads = 2, c.vit_pos_grid = 2;
    c.feature_volume = 2, c.volume = 2, c.windows = {2, 1}, c.volume_ch = 8, c.layers = 2, c.heads = 2;
    c.view_slots = 3, c.view_ch = 3, c.out_ch = 6, c.offset_cells = 3, c.fine_heads = 2, c.fine_hidden = 5;
  } else {
    fail(Status::usage, "no configuration of LaRa's is called {}; there are {}", json_fields::shown(name),
         fmt::join(lara_config_names(), ", "));
  }
  return c;
}

void check(const LaraConfig& c, Status status) {
  const FieldChecks is(status);
  check_bounds(c, is);
  is.need(c.image >= 11, "image must be at least 11, SSIM's window", c.image);
  const std::tuple<const char*, const char*, int, int> multiples[] = {{"image", "patch", c.image, c.patch},
                                                                      {"vit_dim", "vit_heads", c.vit_dim, c.vit_heads},
                                                                      {"volume_ch", "heads", c.volume_ch, c.heads},
                                                                      {"out_ch", "fine_heads", c.out_ch, c.fine_heads}};
  for (const auto& [whole, part, a, b] : multiples)
    is.need(a % b == 0, fmt::format("{} must be a multiple of {}", whole, part), fmt::format("{} and {}", a, b));
  is.need(c.views >= 1 && c.views <= c.view_slots, "views must be 1 to view_slots",
          fmt::format("{} and {}", c.views, c.view_slots));
  is.need(!c.windows.empty() && c.windows.size() <= 16, "windows must have 1 to 16 entries", c.windows.size());
  for (const int n : c.windows)
    is.need(n >= 1 && c.volume % n == 0 && c.feature_volume % n == 0,
            "volume and feature_volume must be multiples of every entry of windows",
            fmt::format("{}, {} and {}", c.volume, c.feature_volume, n));
  is.in("opacity_threshold", c.opacity_threshold, c.opacity_threshold >= 0 && c.opacity_threshold < 1, "in [0,1)");
  is.one_of("kind", c.kind, {"surfel", "gaussian"});
  is.one_of("revision", c.revision, {"lara", "current"});
  is.one_of("rebase", c.rebase, {"rotate", "move"});
  check_sizes(c, is);
}

void set_field(LaraConfig& config, const std::string& assignment) { field_list::set(config, assignment); }

std::string to_json(const LaraConfig& config) { return field_list::text_of(field_list::object_of(config)); }

std::vector<std::string> set_fields_from_json(LaraConfig& config, const std::string& text) {
  return field_list::set_from_json(config, text);
}

LaraConfig lara_config_from_json(const std::string& text, const LaraConfig& base) {
  LaraConfig config = base;
  set_fields_from_json(config, text);
  check(config, Status::format);
  return config;
}

std::string field_text(const LaraConfig& config, const std::string& field) {
  return field_list::field_text(config, field);
}

std::vector<std::string> differing_fields(const LaraConfig& a, const LaraConfig& b,
                                          const std::vector<std::string>& fields) {
  return field_list::differing(a, b, fields);
}

}  // namespace vsplat
