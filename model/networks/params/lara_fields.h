// The list of LaRa's fields, for the configurations that have them.
#pragma once

namespace vsplat {

// Calls visit(name, field) for each, in the header's order.
template <class C, class Visit>
void each_lara_field(C& c, const Visit& visit) {
  visit("image", c.image);
  visit("views", c.views);
  visit("patch", c.patch);
  visit("vit_dim", c.vit_dim);
  visit("vit_depth", c.vit_depth);
  visit("vit_heads", c.vit_heads);
  visit("vit_pos_grid", c.vit_pos_grid);
  visit("feature_volume", c.feature_volume);
  visit("volume", c.volume);
  visit("windows", c.windows);
  visit("volume_ch", c.volume_ch);
  visit("layers", c.layers);
  visit("heads", c.heads);
  visit("view_slots", c.view_slots);
  visit("view_ch", c.view_ch);
  visit("out_ch", c.out_ch);
  visit("primitives", c.primitives);
  visit("kind", c.kind);
  visit("offset_cells", c.offset_cells);
  visit("fine_heads", c.fine_heads);
  visit("fine_hidden", c.fine_hidden);
  visit("fine_features", c.fine_features);
  visit("sh_degree", c.sh_degree);
  visit("opacity_threshold", c.opacity_threshold);
  visit("sample_half_pixel", c.sample_half_pixel);
  visit("negate_camera_centre", c.negate_camera_centre);
  visit("revision", c.revision);
  visit("rebase", c.rebase);
}

}  // namespace vsplat
