// Comparing drawn pictures with given ones of the same cameras.
#pragma once
#include <future>
#include <nlohmann/json_fwd.hpp>
#include <string>
#include <vector>
#include <vsplat/vsplat.hpp>

#include "outputs.h"

namespace command {

// Cameras to draw from: as the library's handle, and each at the requested size.
struct Shots {
  vsplat::Cameras listed;
  std::vector<vsplat_camera> all;
};

std::string index_text(std::size_t index);  // "0007"

class Comparison {
 public:
  // Finds a picture in `folder` for every camera and reads its size; registers them as inputs of `outputs`. Throws if
  // one is missing, smaller than what is drawn, or of another aspect ratio; with `skip_bad` warns and leaves it out.
  // Difference pictures go to `differences`, unless that is "".
  Comparison(std::string folder, std::string differences, const float (&background)[3], Shots shots, Outputs& outputs,
             bool skip_bad);

  // Compares camera `index` as drawn over the background; call it in order, from 0 on. Returns the PSNR as text.
  std::string add(std::size_t index, const vsplat::Picture& drawn, Outputs& outputs);

  // As a table, and as JSON with null for values that are infinite or undefined.
  std::string table() const;
  nlohmann::ordered_json json() const;

  // DIR/0000.png, ...
  static std::string difference_file(const std::string& folder, std::size_t index);

 private:
  struct Row {
    std::size_t index = 0;
    std::string file = {};
    double psnr = 0, psnr_cc = 0, ssim = 0;
  };
  std::string find(std::size_t index) const;
  // Handles the current exception: warns and leaves the picture out, or rethrows.
  void leave_out(std::size_t index, const std::exception& error);
  void compare(std::size_t index, const vsplat::Picture& drawn, const std::vector<float>& given, Outputs& outputs);
  Row mean() const;
  // Reads and prepares the picture of camera `index` in the background.
  std::future<std::vector<float>> load(std::size_t index) const;

  std::string folder_, differences_;
  float background_[3];
  Shots shots_;
  bool skip_bad_;
  std::vector<std::string> files_;  // "": left out
  std::vector<Row> rows_;
  std::future<std::vector<float>> next_;  // of the camera after the last one that was added
};

}  // namespace command
