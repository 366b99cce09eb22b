// LPIPS (Zhang et al. 2018), version 0.1: how different two pictures look, by the features of a network that classifies
// pictures. Its weights are the user's.
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
  // From a safetensors file: torchvision's `features.N.weight` and `features.N.bias` of AlexNet or VGG16, and LPIPS'
  // `linK.model.1.weight`; others are ignored. Error(format) names a tensor that is missing, or is of another shape.
  Lpips(Context& ctx, const std::string& path, LpipsNet net);
  ~Lpips();
  Lpips(Lpips&&) noexcept;

  LpipsNet net() const;
  // The smallest side that the network takes, pixels.
  int smallest() const;

  // Of pictures of one size, 3 channels in [0,1]; 0 for equal ones. Waits. Error(input) where they are smaller than
  // smallest(), or their sizes differ.
  double distance(Context& ctx, const Image& a, const Image& b) const;

 private:
  struct Layer;
  struct Network;
  std::unique_ptr<Network> network_;
};

}  // namespace vsplat
