// vsplat view: writes the page that shows a scene, and opens it in the user's browser.
#include <chrono>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <sstream>
#include <system_error>
#include <thread>

#include "arguments.h"
#include "command.h"
#include "external_program.h"
#include "runtime/system/system.h"
#include "runtime/system/system_process.h"
#include "scene_file.h"
#include "scene_page.h"

namespace command {
namespace {

namespace fs = std::filesystem;
namespace sys = vsplat::sys;

struct ViewOptions {
  Common common;
  std::string scene, before, output, cameras, pictures, background;
  bool no_open = false, skip_bad = false;
};

// $BROWSER lists commands, separated by colons, and comes first; without it the desktop's own opener, if there is one.
std::string browser() {
  std::istringstream named(environment_variable("BROWSER"));
  for (std::string program; std::getline(named, program, ':');)
    if (std::string path = find_program(program); !program.empty() && !path.empty()) return path;
#ifdef __APPLE__
  return find_program("open");
#else
  if (environment_variable("DISPLAY").empty() && environment_variable("WAYLAND_DISPLAY").empty()) return "";
  return find_program("xdg-open");
#endif
}

// True if the program still runs after two seconds, or ended without an error before. start_program() needs a third
// descriptor for it; the page serves, and browsers ignore it.
bool opens(const std::string& program, const fs::path& page) {
  std::error_code error;
  const sys::Handle file = sys::open_to_read(page, error);
  if (error) return false;
  const int process = sys::start_program(program, {page.string()}, file, "", error);
  if (process < 0) return false;
  for (int i = 0; i < 20; ++i) {
    const sys::ProgramEnd end = sys::end_of(process, sys::Wait::no);
    if (end.state != sys::ProgramEnd::State::runs) return end.exit_code == 0;
    std::this_thread::sleep_for(std::chrono::milliseconds(100));
  }
  return true;
}

// A new folder for temporary files that only the user can read. The browser reads the page when this program has ended,
// so the folder stays.
fs::path temporary_folder() {
  const fs::path all = fs::temp_directory_path();
  for (int i = 0; i < 1000; ++i) {
    const fs::path folder = all / ("vsplat-view-" + std::to_string(sys::process_id()) + "-" + std::to_string(i));
    const std::error_code error = sys::make_folder(folder, sys::Whose::owner);
    if (!error) return folder;
    if (error != std::errc::file_exists) throw std::runtime_error(folder.string() + ": " + error.message());
  }
  throw std::runtime_error(all.string() + ": holds too many folders of earlier views");
}

void view(const ViewOptions& o) {
  if (o.no_open && o.output.empty()) throw UsageError("--no-open needs --output, the page to write");
  if (!o.pictures.empty() && o.cameras.empty()) throw UsageError("--pictures needs --cameras, the list of cameras");
  need_ending("--output", o.output, ".html");
  PageViews views{o.cameras, o.pictures};
  if (!o.background.empty()) {
    const std::array<float, 3> behind = colour("--background", o.background);
    std::copy(behind.begin(), behind.end(), views.background);
  }
  set_up_library(o.common);
  Outputs outputs(o.common.overwrite);
  for (const std::string& path : {o.scene, o.before}) outputs.input(path);
  outputs.input_cameras(o.cameras);
  std::vector<PageScene> scenes;
  for (const std::string& path : {o.before, o.scene})
    if (!path.empty()) scenes.push_back({fs::path(path).filename().string(), load_scene(path, o.skip_bad), path});
  const fs::path page = o.output.empty() ? temporary_folder() / fs::path(o.scene).filename().replace_extension(".html")
                                         : fs::path(o.output);
  PageFile file(outputs, page.string(), "", views);
  try {
    file.save(o.common, scenes);
  } catch (...) {
    std::error_code ignored;
    if (o.output.empty()) fs::remove(page.parent_path(), ignored);
    throw;
  }
  outputs.commit();
  bool opened = false;
  if (!o.no_open) {
    const std::string program = browser();
    opened = !program.empty() && opens(program, fs::absolute(page));
    if (!opened)
      warn(page.string() + " is not opened: " +
           (program.empty() ? "no browser was found: $BROWSER names no program, and there is no desktop with xdg-open"
                            : program + " did not open it") +
           "; open the file in a browser");
  }
  if (!o.common.json) return;
  nlohmann::ordered_json out = {{"gaussians", scenes.back().scene.info().count}, {"opened", opened}};
  file.add_results(out);
  print_json(out);
}

}  // namespace

void add_view(CLI::App& app, Run& run) {
  auto o = std::make_shared<ViewOptions>();
  CLI::App* sub = app.add_subcommand("view", "Show a scene in the browser");
  sub->add_option("scene", o->scene, "A scene file in any supported format")->required()->type_name("SCENE");
  sub->add_option("-o,--output", o->output, "The page to write (default: a file in a new temporary folder)")
      ->type_name("FILE.html");
  sub->add_option("--before", o->before, "A second scene, shown to the left of a slider")->type_name("SCENE");
  sub->add_option("--cameras", o->cameras,
                  "Also show these cameras and their photographs (transforms.json, cameras.json, a COLMAP model or a "
                  "folder with one); clicking a camera shows the scene from there")
      ->type_name("CAMERAS");
  sub->add_option("--pictures", o->pictures, "The folder of the photographs (default: that of the camera list)")
      ->type_name("DIR");
  sub->add_option("--background", o->background,
                  "Colour behind the scene: a name, #rrggbb, or r,g,b with each 0 to 1 (default: white)")
      ->type_name("COLOUR");
  sub->add_flag("--skip-bad", o->skip_bad, "Leave out Gaussians that cannot be drawn, and count them");
  sub->add_flag("--no-open", o->no_open, "Only write the page");
  add_common(*sub, o->common, {.device = false, .profile = false});
  sub->footer(
      "Examples:\n"
      "  vsplat view scene.ply\n"
      "  vsplat view scene.ply --cameras photos/ --output scene.html --no-open\n"
      "  vsplat view sharp.ply --before scene.ply\n"
      "The page is one file that contains the scene. It works without a network; the browser needs WebGL 2. Drag to\n"
      "turn, scroll to zoom, press ? for the keys. $BROWSER selects the browser, otherwise the desktop's default is\n"
      "used.");
  sub->callback([o, &run] { run = [o] { view(*o); }; });
}

}  // namespace command
