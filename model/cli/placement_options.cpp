#include "placement_options.h"

#include "command.h"

namespace command {

void add_view_options(CLI::App& app, std::string& pictures, bool& skip_bad) {
  app.add_option("--pictures", pictures,
                 "The folder of the pictures, if they are not at the listed paths: each is found below it by the end "
                 "of its path, also with another ending of its name")
      ->type_name("DIR");
  app.add_flag("--skip-bad", skip_bad,
               "Leave out views that cannot be used (pose, camera, picture or mask), and count them");
}

vsplat_views_options views_options(const std::string& pictures, bool skip_bad, bool named) {
  vsplat_views_options out = VSPLAT_VIEWS_OPTIONS_INIT;
  out.pictures = pictures.empty() ? nullptr : pictures.c_str();
  out.skip_bad = skip_bad;
  out.check_later = named;
  return out;
}

void add_placement_options(CLI::App& app, PlacementOptions& o) {
  const OptionGroup in(app, placement_group);
  app.add_option("--center", o.center,
                 "The cube's centre, world coordinates (default: aabb_center of the file, else estimated)")
      ->type_name("x,y,z");
  app.add_option("--scale", o.scale,
                 "The cube's edge, world units (default: twice aabb_half of the file, else estimated)")
      ->type_name("S");
  app.add_flag("--auto-frame", o.auto_frame,
               "Estimate what is not given even if the file states it: from COLMAP's points, else from masks, else "
               "from the cameras' axes");
  app.add_option("--crop", o.crop,
                 "How pictures of another size or shape are used: object crops around the cube, crop takes the centre "
                 "square, pad adds white, auto resamples square ones and treats others as object")
      ->check(one_of({"auto", "object", "crop", "pad"}))
      ->type_name("auto|object|crop|pad");
}

vsplat_crop crop_of(const PlacementOptions& options) {
  return options.crop == "object" ? VSPLAT_CROP_OBJECT
         : options.crop == "crop" ? VSPLAT_CROP_CROP
         : options.crop == "pad"  ? VSPLAT_CROP_PAD
                                  : VSPLAT_CROP_AUTO;
}

}  // namespace command
