// What the tests of training data share.
#pragma once
#include "model/data/training_views.h"

namespace vsplat::test {

constexpr int kSide = 12;

inline TrainingOptions options_of(int image = kSide) {
  TrainingOptions out;
  out.image = image;
  out.seed = 4;
  out.threads = 0;
  return out;
}

inline bool same(const TrainingViews& a, const TrainingViews& b) {
  bool out = a.object == b.object && a.pictures == b.pictures && a.inputs == b.inputs && a.background == b.background &&
             a.cameras.size() == b.cameras.size();
  for (std::size_t i = 0; out && i < a.cameras.size(); ++i)
    out = a.cameras[i].w2c == b.cameras[i].w2c && a.cameras[i].fx == b.cameras[i].fx &&
          a.cameras[i].cx == b.cameras[i].cx && a.cameras[i].file == b.cameras[i].file;
  return out;
}

}  // namespace vsplat::test
