// LPIPS (Zhang et al. 2018), version 0.1: the perceptual distance of two pictures, from the features of a
// classification network. The user supplies its weights.
#pragma once
#include <memory>
#include <string>

#include "model/base/image.h"
#include "runtime/context.h"

namespace vsplat {

enum class LpipsNet : int { alex = 0, vgg = 1 };
const char* name_of(LpipsNet net);  // "alex", "vgg"

class Lpips {
 public:
  // Reads a safetensors file with torchvision's `features.N.weight` and `features.N.bias` of AlexNet or VGG16, and
  // LPIPS' `linK.model.1.weight`; other tensors are ignored. Error(format) names a missing tensor or one with another
  // shape.
  Lpips(Context& ctx, const std::string& path, LpipsNet net);
  ~Lpips();
  Lpips(Lpips&&) noexcept;

  LpipsNet net() const;
  // The smallest side in pixels that the network accepts.
  int smallest() const;

  // The distance of two pictures of the same size with 3 channels in [0,1]; 0 if they are equal. Waits for the device.
  // Error(input) if they are smaller than smallest() or their sizes differ.
  double distance(Context& ctx, const Image& a, const Image& b) const;

 private:
  struct Layer;
  struct Network;
  std::unique_ptr<Network> network_;
};

}  // namespace vsplat
