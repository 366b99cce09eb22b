// Converts photographs to network input: square, undistorted, on white, each with its pinhole camera.
#pragma once
#include <Eigen/Core>
#include <string>
#include <vector>

#include "model/base/camera.h"
#include "model/base/image.h"
#include "model/base/pixel_rows.h"

namespace vsplat {

// How a picture is cropped: the square of the undistorted picture that becomes the view.
enum class Crop {
  automatic,  // a square picture completely, unchanged if it has the network's size; `object` for other pictures
  object,     // centred on the projected cube centre, 1.5 cube edges (by the larger of fx and fy) wide at its depth
  crop,       // the largest centred square
  pad         // the whole picture, padded with white
};

// "auto", "object", "crop" or "pad"; otherwise Error(usage).
Crop crop_from_name(const std::string& name);

struct Framing {
  int size = 0;  // S, the network's input size
  Crop crop = Crop::automatic;
  Eigen::Vector3d centre = Eigen::Vector3d::Zero();  // the object's cube, in the world
  double edge = 1;
};

struct PreparedView {
  Image image;       // [S][S][3], on white
  Camera camera;     // S x S, no distortion, the listed pose and file name
  Image alpha = {};  // [S][S][1]; empty: 1 everywhere
  // Whether a mask or an alpha channel marks the object. If not, alpha is below 1 only outside the photograph.
  bool masked = false;
};

// As PreparedView, without a background yet.
struct FramedView {
  Image image;  // [S][S][4], premultiplied
  Camera camera;
};

PreparedView on_white(FramedView view, bool masked);

// A whole picture, undistorted, with its pinhole camera.
struct WholeView {
  Image image;    // [H][W][4], premultiplied
  Camera camera;  // W x H, no distortion
  Image known;    // [H][W][1]: 0 for pixels that the lens does not show or `part` leaves out; empty if all are valid
};

// Names of the picture and the mask in messages.
struct PictureNames {
  std::string picture, mask;
};

// `picture` has 3 or 4 channels, `mask` (may be null) 1: white is the object, grey is partial coverage. If the camera
// has no size, it takes the picture's; a missing principal point (NaN, or 0 without a size) is the picture's centre.
// Error(input) if sizes disagree, or if `object` is requested and the cube's centre is not in front of the camera.
// Without `names`, messages use the camera's file.
FramedView frame_view(const Camera& camera, const Image& picture, const Image* mask, const Framing& framing);
FramedView frame_view(const Camera& camera, PixelRows& picture, PixelRows* mask, const Framing& framing,
                      const PictureNames& names);
PreparedView prepare_view(const Camera& camera, const Image& picture, const Image* mask, const Framing& framing);

// As frame_view() for the whole picture; if its longer side exceeds `longest` pixels, it is scaled down to that by area
// (0: unchanged). `part`, of the picture's size with 1 channel, may be null: of pixels that it covers by less than nine
// tenths nothing is known.
WholeView whole_view(const Camera& camera, const Image& picture, const Image* mask, int longest,
                     const PictureNames& names);
WholeView whole_view(const Camera& camera, PixelRows& picture, PixelRows* mask, int longest, const PictureNames& names,
                     PixelRows* part = nullptr);

// Reads the pictures from files; `mask_path` may be empty. Errors name the files.
PreparedView prepare_view(const Camera& camera, const std::string& picture_path, const std::string& mask_path,
                          const Framing& framing);

}  // namespace vsplat
