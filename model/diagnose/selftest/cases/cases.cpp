#include "model/diagnose/selftest/cases/cases.h"

namespace vsplat::selftest {

std::vector<Case> all_cases() {
  std::vector<Case> out;
  for (const auto& list : {product_cases(), list_cases(), norm_cases(), attention_cases(), convolution_cases(),
                           token_cases(), point_cases(), feature_cases(), gaussian_cases(), drawing_cases(),
                           surfel_cases(), projection_cases(), picture_cases(), fitting_cases(), training_cases()})
    out.insert(out.end(), list.begin(), list.end());
  return out;
}

}  // namespace vsplat::selftest
