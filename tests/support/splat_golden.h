// Scenes with the PyTorch specification's pictures and gradients: the files of tests/reference/pytorch/make_splat.py,
// and for surfels those of make_surfels.py, which describe how they avoid thresholds.
#pragma once
#include <array>
#include <optional>
#include <string>
#include <vector>

#include "model/base/camera.h"
#include "model/base/gaussians.h"
#include "model/render/render.h"

namespace vsplat::test {

struct SplatGolden {
  Gaussians gaussians;  // quaternions of any length
  std::vector<Camera> cameras;
  RenderOptions options;          // background, near plane, mirror; for surfels all maps, and the revision
  std::vector<Picture> pictures;  // one a camera
  std::vector<Picture> cotangents;

  // Gradient of the sum over cameras, pictures and pixels of cotangent . picture: with respect to the Gaussians'
  // values, in their shapes, and to xi = (omega, tau) at 0, one per camera, where w2c is replaced by exp([omega, tau])
  // w2c.
  Gaussians gradient;
  std::vector<std::array<double, 6>> pose_gradient;

  // A name of splat_committed(), splat_made(), surfels_committed() or surfels_made().
  static SplatGolden load(const std::string& name);
  static std::string path_of(const std::string& name);
  static bool exists(const std::string& name);
};

const std::vector<std::string>& splat_committed();  // small, in tests/golden/splat/
const std::vector<std::string>& splat_made();       // made by the ctest fixture if PyTorch is installed
// The same for surfels.
const std::vector<std::string>& surfels_committed();
const std::vector<std::string>& surfels_made();
// The committed cases of volumes, and those of the others that exist.
std::vector<std::string> splat_present();

}  // namespace vsplat::test

// In a test's body: skips the test, visibly, if the file has not been made.
#define VSPLAT_NEED_SPLAT(name)                              \
  if (!::vsplat::test::SplatGolden::exists(name))            \
  GTEST_SKIP() << ::vsplat::test::SplatGolden::path_of(name) \
               << " is not there (ctest's golden_splat makes it, with PyTorch)"
