// Scenes that drawing is timed on, the same on every machine:
//   small-5k     5,000 Gaussians on a sphere's shell, SH degree 1; 8 cameras about it, 128 x 128 pixels. For slow
//   devices object-190k  188,003 of the same, as the paper's network makes them: 17 in each of 11,059 voxels; 512 x 512
//   surfels-190k  the same as surfels, without their third deviations
//   slab-1m      a million over hilly ground with boxes on it, of all sizes, SH degree 3; 1280 x 720
// The distributions are those of tests/reference/pytorch/bench_scenes.py, the numbers are not.
#pragma once
#include <string>
#include <vector>

#include "model/base/camera.h"
#include "model/base/scene.h"

namespace vsplat::bench {

struct BenchScene {
  Scene scene;
  std::vector<Camera> cameras;
};

std::vector<std::string> scene_names();  // but for that of surfels
// Every NAME with NAME.ply and NAME.cameras.json in a folder, in order.
std::vector<std::string> scene_names(const std::string& folder);
BenchScene make_scene(const std::string& name);
// NAME.ply and NAME.cameras.json of a folder.
BenchScene read_scene(const std::string& folder, const std::string& name);

}  // namespace vsplat::bench
