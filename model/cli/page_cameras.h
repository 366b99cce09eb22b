// The cameras of a list with their photographs, as a scene's page shows them.
#pragma once
#include <string>
#include <vector>
#include <vsplat/vsplat.hpp>

namespace command {

struct PageCamera {
  std::string name;  // of the photograph, or the camera's number
  vsplat_camera camera = VSPLAT_CAMERA_INIT;
  std::string picture{};  // a data URI; "": none
};

// Where they are read from.
struct PageViews {
  std::string cameras;              // a file or folder that vsplat_cameras_load reads; "": no cameras
  std::string pictures;             // the folder of the photographs; "": that of the cameras
  float background[3] = {1, 1, 1};  // behind photographs with alpha
};

// At most 200 of them, evenly chosen. A photograph that is not found or cannot be read is left out, with a warning that
// counts them; throws if the cameras cannot be read.
std::vector<PageCamera> page_cameras(const PageViews& views);

}  // namespace command
