#include "picture_files.h"

#include <algorithm>
#include <cstdio>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <utility>

#include "naming.h"

namespace command {
namespace {

void add_output_options(CLI::App& app, PictureOptions& o) {
  app.add_option("--images", o.images, "Folder for the pictures: 0000.png, ... in the cameras' order")
      ->type_name("DIR");
  app.add_option("--format", o.format, "Format of --images: 8-bit PNG (default) or JPEG, or EXR with alpha and depth")
      ->check(one_of({"png", "jpg", "exr"}))
      ->type_name("png|jpg|exr");
  app.add_option("--quality", o.quality,
                 "Quality of JPEG and of a .webp --turntable (default: 90; 100: the .webp is lossless)")
      ->type_name("1-100");
  app.add_flag("--exr-raw", o.exr_raw,
               "Write EXR with the rasteriser's own values: floats over the background, without a transfer curve, "
               "depth accumulated");
  app.add_option(
         "--maps", o.maps,
         "Also write where surfaces are: mean depth, depth where half of the light is absorbed, and normals; a list. "
         "With PNG and JPEG as 0000.median.png, ... (depths in 1/1000 world unit, 16 bits), in EXR as layers")
      ->type_name("expected,median,normal");
  app.add_option("--sheet", o.sheet, "A contact sheet of all pictures")->type_name("FILE.png");
  app.add_option("--turntable", o.turntable, "An animation of all pictures, which loops")
      ->type_name("FILE.webp|FILE.gif");
  app.add_option("--fps", o.fps, "Pictures per second of --turntable, 0.1 to 100, for a GIF at most 50 (default: 24)")
      ->type_name("F");
  app.add_option("--write-cameras", o.write_cameras, "Write the cameras of the pictures, in the format of cameras.json")
      ->type_name("FILE.json");
  app.add_option("--compare", o.compare,
                 "Measure PSNR and SSIM against the pictures in this folder: those that the cameras' list names, found "
                 "as by --pictures, or 0000, 0001, ...; larger ones are scaled down")
      ->type_name("DIR");
  app.add_option("--differences", o.differences, "With --compare: folder for 4 x |difference| as 0000.png, ...")
      ->type_name("DIR");
}

}  // namespace

void add_picture_options(CLI::App& app, PictureOptions& o, const char* cameras_option) {
  o.cameras_option = cameras_option;
  const OptionGroup in(app, "Pictures");
  app.add_option(
         cameras_option, o.cameras,
         "Draw the scene from these cameras (transforms.json, cameras.json, COLMAP model or a folder with one), from "
         "N on a circle, or from N on a smooth path through given ones")
      ->type_name("CAMERAS|orbit:N|path:CAMERAS:N");
  add_output_options(app, o);
  app.add_option("--size", o.size,
                 "Size of the pictures; intrinsics are scaled, too (default: from the cameras' file; 512x512 for "
                 "orbit:N and if the file has none)")
      ->type_name("WxH");
  app.add_option("--background", o.background,
                 "Colour behind the scene: a name, #rrggbb, or r,g,b with each 0 to 1; or transparent, which gives "
                 "--images as PNG with alpha (default: white)")
      ->type_name("COLOUR");
  app.add_option("--orbit-radius", o.orbit_radius,
                 "Distance of orbit:N's cameras from its centre, world units (default: from the inputs or the scene)")
      ->type_name("R");
  app.add_option("--orbit-elevation", o.orbit_elevation, "Elevation of orbit:N's cameras, degrees")->type_name("DEG");
  app.add_option("--supersample", o.supersample,
                 "Samples along a pixel's edge, 1 to 8: pictures are drawn this many times larger and averaged "
                 "(default: auto, enough for pictures smaller than the scene's input to keep its detail)")
      ->type_name("N|auto");
  app.add_option("--up", o.up, "Which way is up in the world (default: from the scene's file or the cameras)")
      ->type_name("x,y,z");
}

namespace {

// Refuses options that would have no effect.
void refuse_what_is_of_no_use(const PictureOptions& o, const CameraChoice& choice) {
  if (o.cameras.empty())
    for (const auto& [option, given] :
         {std::pair("--size", !o.size.empty()), std::pair("--background", !o.background.empty()),
          std::pair("--format", !o.format.empty()), std::pair("--supersample", !o.supersample.empty())})
      if (given)
        throw UsageError(option + std::string(" applies to pictures that are drawn: it needs ") + o.cameras_option +
                         ", the cameras");
  if (choice.orbit == 0)
    for (const auto& [option, text] :
         {std::pair("--orbit-radius", &o.orbit_radius), std::pair("--orbit-elevation", &o.orbit_elevation)})
      if (!text->empty()) throw UsageError(option + std::string(" applies to cameras on a circle: it needs orbit:N"));
}

}  // namespace

PictureJob::PictureJob(const PictureOptions& o) : exact_tiles(o.exact_tiles), skip_bad(o.skip_bad) {
  wanted = !o.cameras.empty();
  if (wanted) choice = camera_choice("cameras", o.cameras);
  if (!o.size.empty()) size = picture_size("--size", o.size);
  if (!o.background.empty()) {
    const std::array<float, 3> behind = colour("--background", o.background, &transparent);
    std::copy(behind.begin(), behind.end(), background);
  }
  if (!o.near.empty()) near = positive_number("--near", o.near, "distance in world units");
  supersample = samples("--supersample", o.supersample);
  if (o.antialias == "on") antialias = VSPLAT_ANTIALIAS_ON;
  if (o.antialias == "off") antialias = VSPLAT_ANTIALIAS_OFF;
  read_outputs(o);
  orbit_options.count = choice.orbit;
  if (size) orbit_options.width = size->width, orbit_options.height = size->height;
  if (!o.orbit_radius.empty())
    orbit_options.radius = positive_number("--orbit-radius", o.orbit_radius, "distance in world units");
  if (!o.orbit_elevation.empty()) {
    orbit_options.has_elevation = 1;
    orbit_options.elevation = number("--orbit-elevation", o.orbit_elevation);
    if (orbit_options.elevation <= -90 || orbit_options.elevation >= 90)
      throw UsageError("--orbit-elevation is \"" + o.orbit_elevation + "\": degrees between -90 and 90 expected");
  }
  if (!o.up.empty()) {
    const std::array<double, 3> up = triple("--up", o.up);
    if (up[0] == 0 && up[1] == 0 && up[2] == 0) throw UsageError("--up is \"" + o.up + "\": not a direction");
    orbit_options.has_up = 1;
    for (int i = 0; i < 3; ++i) orbit_options.up[i] = up[static_cast<std::size_t>(i)];
  }
  refuse_what_is_of_no_use(o, choice);
}

void PictureJob::read_turntable(const PictureOptions& o) {
  if (!o.fps.empty()) {
    animation_options.fps = number("--fps", o.fps);
    if (animation_options.fps < 0.1 || animation_options.fps > 100)
      throw UsageError("--fps is \"" + o.fps + "\": 0.1 to 100 pictures per second expected");
    if (turntable.empty()) throw UsageError("--fps needs --turntable");
  }
  if (turntable.empty()) return;
  const std::string ending = lower_case(std::filesystem::path(turntable).extension());
  if (ending != ".webp" && ending != ".gif")
    throw UsageError("--turntable is \"" + turntable +
                     "\": a name that ends in .webp or .gif expected; an MP4 can be made of the pictures, --images "
                     "frames/: ffmpeg -framerate " +
                     (o.fps.empty() ? std::string("24") : o.fps) + " -i frames/%04d.png -pix_fmt yuv420p turn.mp4");
  animation_options.format = ending == ".gif" ? VSPLAT_ANIMATION_GIF : VSPLAT_ANIMATION_WEBP;
  try {
    const vsplat::Animation possible(animation_options);
  } catch (const vsplat::Error& e) {
    throw UsageError("--turntable " + turntable + ": " + e.what());
  }
}

void PictureJob::read_outputs(const PictureOptions& o) {
  images = o.images, sheet = o.sheet, turntable = o.turntable, compare = o.compare, differences = o.differences;
  write_cameras = o.write_cameras;
  drawn = !images.empty() || !sheet.empty() || !turntable.empty() || !compare.empty();
  written = drawn || !write_cameras.empty();
  need_ending("--sheet", sheet, ".png");
  read_turntable(o);
  need_ending("--write-cameras", write_cameras, ".json");
  if (!o.maps.empty()) {
    maps = list("--maps", o.maps);
    for (const std::string& map : maps)
      if (map != "expected" && map != "median" && map != "normal")
        throw UsageError("--maps names \"" + map + "\": expected, median and normal are known");
    if (written && images.empty()) throw UsageError("--maps applies to --images: give the folder for them");
  }
  if (o.exr_raw && o.format != "exr") throw UsageError("--exr-raw needs --format exr");
  if (!o.format.empty() && written && images.empty())
    throw UsageError("--format applies to --images: give the folder for them");
  if (!differences.empty() && compare.empty()) throw UsageError("--differences needs --compare");
  if (!o.quality.empty()) {
    const double value = number("--quality", o.quality);
    if (value < 1 || value > 100 || value != static_cast<int>(value))
      throw UsageError("--quality is \"" + o.quality + "\": a whole number from 1 to 100 expected");
    if ((turntable.empty() || animation_options.format == VSPLAT_ANIMATION_GIF) && o.format != "jpg")
      throw UsageError("--quality needs --format jpg or --turntable FILE.webp");
    animation_options.quality = quality = static_cast<int>(value);
  }
  if (transparent && written && images.empty())
    throw UsageError("--background transparent needs --images: contact sheets, animations and comparisons are opaque");
  if (transparent && (o.format == "jpg" || o.exr_raw))
    throw UsageError(std::string("--background transparent works with PNG and EXR: ") +
                     (o.exr_raw ? "--exr-raw holds what is drawn over a colour" : "JPEG holds no transparency"));
  format = o.format == "jpg"   ? VSPLAT_PICTURE_JPEG
           : o.format != "exr" ? (transparent ? VSPLAT_PICTURE_PNG_ALPHA : VSPLAT_PICTURE_PNG)
           : o.exr_raw         ? VSPLAT_PICTURE_EXR_RAW
                               : VSPLAT_PICTURE_EXR;
}

Shots PictureJob::load_cameras() const {
  const Size unknown = size.value_or(Size{default_size, default_size});
  Shots out;
  vsplat_cameras_options read = VSPLAT_CAMERAS_OPTIONS_INIT;
  read.width = unknown.width, read.height = unknown.height;
  read.skip_bad = skip_bad;
  out.listed = vsplat::Cameras::load(choice.file, read);
  if (choice.path) out.listed = naming({choice.file}, {}, [&] { return out.listed.path(choice.path); });
  out.all = out.listed.all();
  if (!size) return out;
  for (vsplat_camera& c : out.all) {
    const double x = static_cast<double>(size->width) / c.width, y = static_cast<double>(size->height) / c.height;
    c.fx *= x, c.cx *= x, c.fy *= y, c.cy *= y;
    c.width = size->width, c.height = size->height;
  }
  return out;
}

std::string PictureJob::file(std::size_t index) const {
  const char* ending = format == VSPLAT_PICTURE_JPEG ? "jpg" : writes_exr() ? "exr" : "png";
  return (std::filesystem::path(images) / (index_text(index) + "." + ending)).string();
}

std::vector<std::string> PictureJob::map_files(std::size_t index) const {
  std::vector<std::string> out;
  for (const std::string& map : maps)
    if (!writes_exr())
      out.push_back((std::filesystem::path(images) / (index_text(index) + "." + map + ".png")).string());
  return out;
}

void PictureJob::expect(Outputs& outputs, std::size_t count) const {
  for (std::size_t i = 0; i < count; ++i) {
    if (!images.empty()) outputs.expect(file(i));
    for (const std::string& map : map_files(i)) outputs.expect(map);
    if (!differences.empty()) outputs.expect(Comparison::difference_file(differences, i));
  }
  for (const std::string& file : {sheet, turntable, write_cameras}) outputs.expect(file);
  clear_stale(outputs, count);
}

void PictureJob::clear_stale(Outputs& outputs, std::size_t count) const {
  const auto rest = [&](const auto& name) {
    std::error_code error;
    for (std::size_t i = count; std::filesystem::is_regular_file(name(i), error); ++i) outputs.expect_gone(name(i));
  };
  if (!images.empty()) rest([&](std::size_t i) { return file(i); });
  for (std::size_t m = 0; m < map_files(0).size(); ++m) rest([&](std::size_t i) { return map_files(i)[m]; });
  if (!differences.empty()) rest([&](std::size_t i) { return Comparison::difference_file(differences, i); });
}

// Picture names in the file are paths from it to --images, so that the two together are posed views.
void PictureJob::save_cameras(const std::vector<vsplat_camera>& all, Outputs& outputs) const {
  namespace fs = std::filesystem;
  std::vector<std::string> names;
  std::vector<const char*> files;
  files.reserve(all.size());
  for (std::size_t i = 0; i < all.size(); ++i) {
    const fs::path picture = fs::absolute(file(i)).lexically_normal();
    const fs::path from = fs::absolute(write_cameras).lexically_normal().parent_path();
    names.push_back((images.empty() ? picture.filename() : picture.lexically_relative(from)).string());
  }
  for (const std::string& name : names) files.push_back(name.c_str());
  vsplat::check(vsplat_cameras_save(all.data(), all.size(), files.data(), outputs.begin(write_cameras).c_str()));
}

std::optional<Comparison> PictureJob::prepare(const Shots& shots, Outputs& outputs) const {
  const auto other = std::find_if(shots.all.begin(), shots.all.end(), [&](const vsplat_camera& c) {
    return c.width != shots.all[0].width || c.height != shots.all[0].height;
  });
  if (!turntable.empty() && other != shots.all.end())
    throw UsageError("--turntable needs pictures of one size: camera " + std::to_string(other - shots.all.begin()) +
                     " draws " + std::to_string(other->width) + " x " + std::to_string(other->height) +
                     " pixels, the first one " + std::to_string(shots.all[0].width) + " x " +
                     std::to_string(shots.all[0].height) + "; --size makes them equal");
  if (compare.empty()) return std::nullopt;
  return Comparison(compare, differences, background, shots, outputs, skip_bad);
}

// A picture drawn over black, composited over the background.
vsplat::Picture PictureJob::over_background(const vsplat::Picture& picture) const {
  vsplat::Picture out = picture;
  for (std::size_t i = 0; i < out.colour.size(); ++i) out.colour[i] += (1 - out.alpha[i / 3]) * background[i % 3];
  return out;
}

bool PictureJob::over_black() const {
  return !images.empty() && (format == VSPLAT_PICTURE_EXR || format == VSPLAT_PICTURE_PNG_ALPHA);
}

void PictureJob::save(const vsplat::Picture& picture, std::size_t index, Outputs& outputs) const {
  if (format == VSPLAT_PICTURE_JPEG)
    picture.save_jpeg(outputs.begin(file(index)), quality);
  else
    picture.save(outputs.begin(file(index)), format);
  const std::vector<std::string> files = map_files(index);
  for (std::size_t i = 0; i < files.size(); ++i)
    picture.save(outputs.begin(files[i]), maps[i] == "expected" ? VSPLAT_PICTURE_PNG_EXPECTED
                                          : maps[i] == "median" ? VSPLAT_PICTURE_PNG_MEDIAN
                                                                : VSPLAT_PICTURE_PNG_NORMAL);
}

void PictureJob::draw(Session& session, const vsplat::Scene& scene, const std::vector<vsplat_camera>& all,
                      std::optional<Comparison>& comparison, Outputs& outputs) const {
  if (!write_cameras.empty()) save_cameras(all, outputs);
  if (!drawn) return;
  vsplat_render_options options = VSPLAT_RENDER_OPTIONS_INIT;
  options.near_plane = near;
  options.exact_tiles = exact_tiles;
  options.supersample = supersample;
  options.antialias = antialias;
  // A file with alpha contains no background, so it is drawn over black.
  if (!over_black()) std::copy(std::begin(background), std::end(background), options.background);
  if (over_black()) std::fill(std::begin(options.background), std::end(options.background), 0.0f);
  vsplat_sheet_options sheet_options = VSPLAT_SHEET_OPTIONS_INIT;
  sheet_options.expected = static_cast<int32_t>(all.size());
  vsplat::Sheet cells = sheet.empty() ? vsplat::Sheet() : vsplat::Sheet(sheet_options);
  vsplat::Animation frames = turntable.empty() ? vsplat::Animation() : vsplat::Animation(animation_options);
  session.start("drawing");
  const auto tell = [&](const char* stage, double done) {
    if (!Session::on_progress(&session, stage, done / static_cast<double>(all.size())))
      throw vsplat::Error(VSPLAT_ERROR_CANCELLED, "stopped");
  };
  std::vector<vsplat::Picture> pictures(all.size());  // pictures that wait for their turn
  const auto work = [&](const vsplat::Device& device, std::size_t i) {
    tell("splat", static_cast<double>(i));
    vsplat::Picture picture(all[i].width, all[i].height);
    for (const std::string& map : maps) {
      std::vector<float>& plane = map == "expected" ? picture.expected
                                  : map == "median" ? picture.median
                                                    : picture.normal;
      plane.resize((map == "normal" ? 3 : 1) * picture.alpha.size());
    }
    vsplat::render(device, scene, all[i], picture, options);
    pictures[i] = std::move(picture);
  };
  const auto done = [&](std::size_t i) {
    vsplat::Picture picture = std::exchange(pictures[i], {});
    if (!images.empty()) save(picture, i, outputs);
    if (over_black() && (cells || frames || comparison)) picture = over_background(picture);
    std::string label = index_text(i);
    if (comparison) {
      tell("compare", static_cast<double>(i) + 0.5);
      label += "  " + comparison->add(i, picture, outputs) + " dB";
    }
    if (cells) cells.add(picture, label);
    if (frames) frames.add(picture);
  };
  constexpr std::size_t ahead = 4;  // pictures that may wait for each device
  vsplat::share_out(session.devices(), all.size(), work, done, ahead * session.devices().size());
  if (cells) cells.save(outputs.begin(sheet));
  if (frames) frames.save(outputs.begin(turntable));
}

std::string PictureJob::summary(std::size_t count) const {
  const std::string of = drawn ? " picture" : " camera";
  std::string out = std::to_string(count) + of + (count == 1 ? "" : "s");
  if (!images.empty()) out += " in " + images;
  for (const std::string& file : {sheet, turntable, write_cameras})
    if (!file.empty()) out += ", " + file;
  return out;
}

void PictureJob::add_results(const std::optional<Comparison>& comparison, nlohmann::ordered_json& out) const {
  if (!sheet.empty()) out["sheet"] = sheet;
  if (!turntable.empty()) out["turntable"] = turntable;
  if (!write_cameras.empty()) out["cameras"] = write_cameras;
  if (comparison) out["comparison"] = comparison->json();
}

}  // namespace command
