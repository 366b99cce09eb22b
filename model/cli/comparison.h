// Drawn pictures against given ones of the same cameras: how well they agree, and where they do not.
#pragma once
#include <future>
#include <nlohmann/json_fwd.hpp>
#include <string>
#include <vector>
#include <vsplat/vsplat.hpp>

#include "outputs.h"

namespace command {

// Cameras to draw from: as the library holds them, and each, in the size asked for.
struct Shots {
  vsplat::Cameras listed;
  std::vector<vsplat_camera> all;
};

std::string index_text(std::size_t index);  // "0007"

class Comparison {
 public:
  // Finds a picture in `folder` for every camera and looks at its size; `outputs` will not write over it. An error
  // where one is missing, smaller than what is drawn or of other proportions; with `skip_bad` a warning, and it is left
  // out. Difference pictures go to `differences` unless that is "".
  Comparison(std::string folder, std::string differences, const float (&background)[3], Shots shots, Outputs& outputs,
             bool skip_bad);

  // Camera `index` as drawn over the background; to be called for one after the other, from 0 on. Returns its PSNR as
  // text.
  std::string add(std::size_t index, const vsplat::Picture& drawn, Outputs& outputs);

  // For people; and for machines, with null for what is infinite or not defined.
  std::string table() const;
  nlohmann::ordered_json json() const;

  // DIR/0000.png, ...
  static std::string difference_file(const std::string& folder, std::size_t index);

 private:
  struct Row {
    std::size_t index = 0;
    std::string file = {};
    double psnr = 0, ssim = 0;
  };
  std::string find(std::size_t index) const;
  // Of the exception that is being handled: thrown again where it must be.
  void leave_out(std::size_t index, const std::exception& error);
  void compare(std::size_t index, const vsplat::Picture& drawn, const std::vector<float>& given, Outputs& outputs);
  Row mean() const;
  // Reads and prepares the picture of camera `index` beside what else is done.
  std::future<std::vector<float>> load(std::size_t index) const;

  std::string folder_, differences_;
  float background_[3];
  Shots shots_;
  bool skip_bad_;
  std::vector<std::string> files_;  // "": left out
  std::vector<Row> rows_;
  std::future<std::vector<float>> next_;  // the picture after the last one that was added
};

}  // namespace command
