// A written scene compared with the one that it was made from: pictures, and values.
#pragma once
#include <cstddef>
#include <nlohmann/json_fwd.hpp>
#include <optional>
#include <string>
#include <vsplat/vsplat.hpp>

#include "session.h"

namespace command {

class SceneCheck {
 public:
  // Draws `original` and `written` from eight cameras on a circle about the scene, 512 x 512 pixels over white.
  // `scene` is what was written, whose values are compared: the original, or what was left of it.
  SceneCheck(Session& session, const vsplat::Scene& original, const vsplat::Scene& scene, const vsplat::Scene& written);

  double psnr() const { return psnr_; }  // of all pictures together, dB; infinite if they are equal
  std::string text() const;              // what was found, for a reader
  // "verification" with the figures; an infinite PSNR is null.
  void add_results(double limit, nlohmann::ordered_json& out) const;

 private:
  std::size_t pictures_ = 0;
  double psnr_ = 0, worst_ = 0;
  std::optional<vsplat_scene_difference> difference_;  // nothing if the numbers or the kinds of Gaussians differ
};

}  // namespace command
