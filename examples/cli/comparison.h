// Drawn pictures against given ones of the same cameras: how well they agree, and where they do not.
#pragma once
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

class Comparison {
 public:
  // Finds a picture in `folder` for every camera and looks at its size; `outputs` will not write over it. An error
  // where one is missing or of another size. Difference pictures go to `differences` unless that is "".
  Comparison(std::string folder, std::string differences, const float (&background)[3], Shots shots, Outputs& outputs);

  // Camera `index` as drawn over the background.
  void add(std::size_t index, const vsplat::Picture& drawn, Outputs& outputs);

  // For people; and for machines, with null for what is infinite or not defined.
  std::string table() const;
  nlohmann::ordered_json json() const;

  // DIR/0000.png, ...
  static std::string difference_file(const std::string& folder, std::size_t index);

 private:
  struct Row {
    std::string file;
    double psnr, ssim;
  };
  Row mean() const;

  std::string folder_, differences_;
  float background_[3];
  Shots shots_;
  std::vector<std::string> files_;
  std::vector<Row> rows_;
};

}  // namespace command
