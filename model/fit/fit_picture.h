// A picture that a scene is fitted to, or judged by.
#pragma once
#include <cstdint>
#include <string>
#include <vector>

#include "model/base/camera.h"
#include "runtime/tensor.h"

namespace vsplat {

class Context;

struct FitPicture {
  std::string name;
  Camera camera;                    // W x H, pinhole, in the frame that is fitted in
  std::vector<std::uint8_t> rgba;   // [H,W,4]: colour premultiplied by alpha, alpha
  std::vector<std::uint8_t> known;  // [H,W]: 0 where nothing is known of the pixel; empty: all is
  bool masked = false;              // whether alpha says what is the object; else it is 1 wherever the pixel is known
};

// The same on the device.
struct DeviceFitPicture {
  Camera camera;
  Tensor given, known;  // u8 [H,W,4]; u8 [H,W] or none
  bool masked = false;
};

DeviceFitPicture upload(Context& ctx, const FitPicture& picture);

}  // namespace vsplat
