// A picture that a scene is fitted to, or is measured on.
#pragma once
#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "model/base/camera.h"
#include "runtime/tensor.h"

namespace vsplat {

class Context;

struct FitPicture {
  std::string name;
  Camera camera;                    // W x H, pinhole, in the frame of the fit
  std::vector<std::uint8_t> rgba;   // [H,W,4]: colour premultiplied by alpha, alpha
  std::vector<std::uint8_t> known;  // [H,W]: the mask, 0 where a pixel is unknown; empty: every pixel is known
  bool masked = false;              // whether alpha marks the object; otherwise alpha is 1 at every known pixel
  std::vector<float> depth = {};    // [H,W]: as DepthLoss::given, in the frame of the fit; empty: none is given
};

std::size_t bytes_of(const FitPicture& picture);

// A FitPicture in device memory.
struct DeviceFitPicture {
  Camera camera;
  Tensor given, known;  // u8 [H,W,4]; u8 [H,W] or empty
  bool masked = false;
  double known_share = 1;   // of the pixels
  double window_share = 1;  // known_window_share()
  Tensor depth = {};        // f32 [H,W], or empty
  double known_depths = 0;  // pixels with a given depth
};

DeviceFitPicture upload(Context& ctx, const FitPicture& picture);

// The share of a picture's pixels that are known.
double known_share(const FitPicture& picture);

// The share of the windows of SSIM in a picture (loss.h) that hold a known pixel; 1 if it is too small for a window.
// `known` as FitPicture::known.
double known_window_share(std::span<const std::uint8_t> known, int width, int height);

}  // namespace vsplat
