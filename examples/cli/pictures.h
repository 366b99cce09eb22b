// Drawing a scene from many cameras into picture files: what reconstruct and render have in common.
#pragma once
#include <array>
#include <optional>
#include <string>
#include <vector>
#include <vsplat/vsplat.hpp>

#include "arguments.h"
#include "outputs.h"
#include "session.h"

namespace command {

struct PictureOptions {
  std::string cameras;  // a file or folder, or orbit:N
  std::string images;   // the folder
  std::string size, background, format = "png", near, orbit_radius, orbit_elevation, up;
  bool exr_raw = false;
};

// `cameras_option`: "--render" or "--cameras".
void add_picture_options(CLI::App& app, PictureOptions& options, const char* cameras_option);

// The same, read: everything that can be wrong with the request itself is found here.
struct PictureJob {
  explicit PictureJob(const PictureOptions& options);

  bool wanted = false;
  std::optional<int> orbit;
  std::optional<Size> size;
  std::array<double, 3> background{1, 1, 1};
  double near = 0;  // 0: the scene's
  vsplat_picture_format format = VSPLAT_PICTURE_PNG;
  vsplat_orbit_options orbit_options = VSPLAT_ORBIT_OPTIONS_INIT;
  std::string cameras, images;

  // The cameras of a file, in the size asked for. `fallback`: for cameras that tell no size.
  std::vector<vsplat_camera> load_cameras(int fallback) const;
  // DIR/0000.png, ...
  std::string file(std::size_t index) const;
  void expect(Outputs& outputs, std::size_t count) const;
  void draw(Session& session, const vsplat::Scene& scene, const std::vector<vsplat_camera>& all,
            Outputs& outputs) const;
};

}  // namespace command
