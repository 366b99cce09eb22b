// Drawing a scene from many cameras into picture files: what reconstruct and render share.
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

// Side of a picture in pixels, if neither --size nor the cameras give one.
inline constexpr int default_size = 512;

struct PictureOptions {
  const char* cameras_option = "";  // the name of the option below
  std::string cameras;              // a file or folder, orbit:N or path:CAMERAS:N
  std::string images;               // the folder
  std::string size, background, format, quality, near, orbit_radius, orbit_elevation, up, supersample;
  std::string sheet, turntable, fps, compare, differences, write_cameras;
  std::string antialias, maps;
  bool exr_raw = false, exact_tiles = false, skip_bad = false;
};

// `cameras_option`: "--render" or "--cameras".
void add_picture_options(CLI::App& app, PictureOptions& options, const char* cameras_option);

// Parsed options; the constructor reports every error of the request itself.
struct PictureJob {
  explicit PictureJob(const PictureOptions& options);

  bool wanted = false;   // cameras are given
  bool drawn = false;    // some option needs drawn pictures
  bool written = false;  // pictures are drawn, or cameras are written
  CameraChoice choice;
  std::optional<Size> size;
  float background[3] = {1, 1, 1};  // white for `transparent`, for formats without alpha
  bool transparent = false;         // for --images
  double near = 0;                  // 0: the scene's
  bool exact_tiles = false, skip_bad = false;
  vsplat_antialias antialias = VSPLAT_ANTIALIAS_SCENE;
  std::uint64_t supersample = 0;  // 0: chosen by the scene
  vsplat_picture_format format = VSPLAT_PICTURE_PNG;
  int quality = 90;
  std::vector<std::string> maps;  // surface maps: expected, median, normal
  vsplat_orbit_options orbit_options = VSPLAT_ORBIT_OPTIONS_INIT;
  vsplat_animation_options animation_options = VSPLAT_ANIMATION_OPTIONS_INIT;
  std::string images, sheet, turntable, compare, differences, write_cameras;

  // The cameras of a file or on a path, at the requested size, or default_size if they give none.
  Shots load_cameras() const;
  // DIR/0000.png, ...
  std::string file(std::size_t index) const;
  // DIR/0000.median.png, ...; layers of an EXR have no files.
  std::vector<std::string> map_files(std::size_t index) const;
  void expect(Outputs& outputs, std::size_t count) const;
  // Checks the cameras before anything is drawn, and finds the pictures to compare with.
  std::optional<Comparison> prepare(const Shots& shots, Outputs& outputs) const;
  void draw(Session& session, const vsplat::Scene& scene, const std::vector<vsplat_camera>& all,
            std::optional<Comparison>& comparison, Outputs& outputs) const;
  // "24 pictures in DIR, FILE.png": what draw() has written.
  std::string summary(std::size_t count) const;
  // Adds the fields "sheet", "turntable" and "comparison", if requested.
  void add_results(const std::optional<Comparison>& comparison, nlohmann::ordered_json& out) const;

 private:
  void read_turntable(const PictureOptions& options);
  void read_outputs(const PictureOptions& options);
  // Whether pictures are drawn over black, to be saved with alpha.
  bool over_black() const;
  // Removes files of --images or --differences that an earlier run with more cameras left.
  void clear_stale(Outputs& outputs, std::size_t count) const;
  bool writes_exr() const { return format == VSPLAT_PICTURE_EXR || format == VSPLAT_PICTURE_EXR_RAW; }
  void save(const vsplat::Picture& picture, std::size_t index, Outputs& outputs) const;
  void save_cameras(const std::vector<vsplat_camera>& all, Outputs& outputs) const;
  vsplat::Picture over_background(const vsplat::Picture& picture) const;
};

}  // namespace command
