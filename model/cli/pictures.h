// Drawing a scene from many cameras into picture files: what reconstruct and render have in common.
#pragma once
#include <array>
#include <nlohmann/json_fwd.hpp>
#include <optional>
#include <string>
#include <vector>
#include <vsplat/vsplat.hpp>

#include "arguments.h"
#include "comparison.h"
#include "outputs.h"
#include "session.h"

namespace command {

// Pixels to a side of what is drawn, where neither --size nor the cameras tell.
inline constexpr int default_size = 512;

struct PictureOptions {
  std::string cameras;  // a file or folder, orbit:N or path:CAMERAS:N
  std::string images;   // the folder
  std::string size, background, format, quality, near, orbit_radius, orbit_elevation, up, supersample;
  std::string sheet, turntable, fps, compare, differences, write_cameras;
  bool exr_raw = false, exact_tiles = false, skip_bad = false;
};

// `cameras_option`: "--render" or "--cameras".
void add_picture_options(CLI::App& app, PictureOptions& options, const char* cameras_option);

// The same, read: everything that can be wrong with the request itself is found here.
struct PictureJob {
  explicit PictureJob(const PictureOptions& options);

  bool wanted = false;   // cameras are given
  bool drawn = false;    // something is asked for that is made of pictures
  bool written = false;  // that, or the cameras
  CameraChoice choice;
  std::optional<Size> size;
  float background[3] = {1, 1, 1};  // white where `transparent`, for what cannot be
  bool transparent = false;         // of --images
  double near = 0;                  // 0: the scene's
  bool exact_tiles = false, skip_bad = false;
  std::uint64_t supersample = 0;  // 0: as the scene asks for
  vsplat_picture_format format = VSPLAT_PICTURE_PNG;
  int quality = 90;
  vsplat_orbit_options orbit_options = VSPLAT_ORBIT_OPTIONS_INIT;
  vsplat_animation_options animation_options = VSPLAT_ANIMATION_OPTIONS_INIT;
  std::string images, sheet, turntable, compare, differences, write_cameras;

  // The cameras of a file or on a path, in the size asked for, or default_size where they tell none.
  Shots load_cameras() const;
  // DIR/0000.png, ...
  std::string file(std::size_t index) const;
  void expect(Outputs& outputs, std::size_t count) const;
  // What must hold of the cameras before anything is drawn; finds the pictures to compare with.
  std::optional<Comparison> prepare(const Shots& shots, Outputs& outputs) const;
  void draw(Session& session, const vsplat::Scene& scene, const std::vector<vsplat_camera>& all,
            std::optional<Comparison>& comparison, Outputs& outputs) const;
  // "24 pictures in DIR, FILE.png": what draw() has written.
  std::string summary(std::size_t count) const;
  // The fields "sheet", "turntable" and "comparison", as far as they were asked for.
  void add_results(const std::optional<Comparison>& comparison, nlohmann::ordered_json& out) const;

 private:
  void read_outputs(const PictureOptions& options);
  // Drawn over black, to be saved with its alpha.
  bool over_black() const;
  // The files of --images or --differences that an earlier run with more cameras left there.
  void clear_stale(Outputs& outputs, std::size_t count) const;
  void save_cameras(const std::vector<vsplat_camera>& all, Outputs& outputs) const;
  vsplat::Picture over_background(const vsplat::Picture& picture) const;
};

}  // namespace command
