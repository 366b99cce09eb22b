// Photographs made into what the network takes: square, undistorted, on white, each with the pinhole that took it.
#pragma once
#include <Eigen/Core>
#include <string>
#include <vector>

#include "model/base/camera.h"
#include "model/base/image.h"
#include "model/base/pixel_rows.h"

namespace vsplat {

// Which square of the undistorted picture becomes the view.
enum class Fit {
  automatic,  // all of a square picture, unchanged where it has the network's size; `object` for others
  object,     // centred on the projected cube centre, 1.5 cube edges (by the larger of fx and fy) wide at its depth
  crop,       // the largest centred square
  pad         // all of the picture, white beside it
};

// "auto", "object", "crop" or "pad"; else Error(usage).
Fit fit_from_name(const std::string& name);

struct Framing {
  int size = 0;  // S, the network's
  Fit fit = Fit::automatic;
  Eigen::Vector3d centre = Eigen::Vector3d::Zero();  // the object's cube, in the world
  double edge = 1;
};

struct PreparedView {
  Image image;    // [S][S][3], on white
  Camera camera;  // S x S, no distortion, the listed pose and file name
};

// The same with its background still open.
struct FramedView {
  Image image;  // [S][S][4], premultiplied
  Camera camera;
};

// All of a picture, undistorted, with the pinhole that took it.
struct WholeView {
  Image image;    // [H][W][4], premultiplied
  Camera camera;  // W x H, no distortion
  Image known;    // [H][W][1]: 0 where the lens shows nothing of the pixel; empty: all is known
};

// What messages call the picture and the mask.
struct PictureNames {
  std::string picture, mask;
};

// `picture` has 3 or 4 channels, `mask` (may be null) 1: white is the object, grey covers in part. Where the camera
// gives no size it takes the picture's, and its middle where it gives no principal point (NaN, or 0 without a size).
// Error(input) where sizes disagree, or where `object` is asked for and the cube's centre is not in front of the
// camera. Without `names` messages go by the camera's file.
FramedView frame_view(const Camera& camera, const Image& picture, const Image* mask, const Framing& framing);
FramedView frame_view(const Camera& camera, PixelRows& picture, PixelRows* mask, const Framing& framing,
                      const PictureNames& names);
PreparedView prepare_view(const Camera& camera, const Image& picture, const Image* mask, const Framing& framing);

// As frame_view(), but all of the picture; its longer side made `longest` pixels where it is longer (0: kept), by area.
WholeView whole_view(const Camera& camera, const Image& picture, const Image* mask, int longest,
                     const PictureNames& names);
WholeView whole_view(const Camera& camera, PixelRows& picture, PixelRows* mask, int longest, const PictureNames& names);

// The same from files; `mask_path` may be empty. Errors name them.
PreparedView prepare_view(const Camera& camera, const std::string& picture_path, const std::string& mask_path,
                          const Framing& framing);

}  // namespace vsplat
