// The page that shows a scene in a browser. Its file has all that it needs inside, and fetches nothing.
#pragma once
#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>
#include <vsplat/vsplat.hpp>

#include "command.h"
#include "outputs.h"
#include "page_cameras.h"

namespace command {

struct PageScene {
  std::string name;  // beside the slider between two scenes
  vsplat::Scene scene;
  std::string file{};  // from which it was read, for errors; empty: the page's
};

struct ScenePage {
  std::string title;
  std::vector<PageScene> scenes;  // one, or two with a slider between them; the last one is what the page saves
  std::vector<PageCamera> cameras;
  float background[3] = {1, 1, 1};
  bool quiet = false;  // no warning of Gaussians that are left out
};

// The version of the SPZ files in pages: browsers decompress its gzip by themselves.
inline constexpr int32_t page_spz_version = 3;

// A file of viewer/.
std::string viewer_file(std::string_view name);

// The SPZ file of a scene in a page, without Gaussians that are too far away. Throws if the scene cannot be written so.
// `path`, of the page, is for errors.
std::vector<unsigned char> page_spz(const PageScene& scene, const std::string& path, bool quiet = false);

// Throws if a scene cannot be written as SPZ. `path`, of the page, is for errors.
std::string scene_page_text(const ScenePage& page, const std::string& path);

// Whether a path ends in .html, in lower or upper case.
bool is_page(const std::string& path);

// The page of a command that makes or reads a scene.
class PageFile {
 public:
  // `viewer`: of --viewer; "": no page is written, unless `output`, the command's main output, is one.
  PageFile(Outputs& outputs, const std::string& output, std::string viewer, PageViews views);

  // Writes the page, or does nothing if none is wanted. A page that cannot be made is an error. If the page is the main
  // output, a message says what the SPZ file inside loses of the last scene; the page itself keeps up and near plane.
  void save(const Common& common, const std::vector<PageScene>& scenes);
  void add_results(nlohmann::ordered_json& out) const;  // "viewer", and "lost" of a main output

 private:
  Outputs& outputs_;
  std::string path_;
  PageViews views_;
  bool is_output_;
  std::optional<std::vector<PageCamera>> cameras_;  // a fit writes its page twice
  std::vector<std::string> lost_;
};

// Adds --viewer.
void add_viewer_option(CLI::App& app, std::string& path, const std::string& group);

}  // namespace command
