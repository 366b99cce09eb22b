// The photographs that a scene is fitted to, decoded once and kept while they fit under a cap.
#pragma once
#include <cstdint>
#include <list>
#include <map>
#include <memory>

#include "model/base/scene.h"
#include "model/fit/fit_picture.h"
#include "model/input/photographs.h"

namespace vsplat {

class FitPictures {
 public:
  // In the frame that `to_world` leads out of; a picture's longer side is at most `longest` pixels (0: as it is).
  // `cap`: bytes of host memory that decoded pictures may take together, but for the one that is asked for.
  FitPictures(const Photographs& photographs, const Similarity& to_world, int longest, std::size_t cap);

  // Decodes where it must. Errors as LoadedPhotograph's; Error(input) where a pixel's value is no number.
  std::shared_ptr<const FitPicture> at(int view);

 private:
  struct Kept {
    std::shared_ptr<const FitPicture> picture;
    std::list<int>::iterator age;
  };
  std::shared_ptr<const FitPicture> load(int view) const;

  const Photographs& photographs_;
  Similarity to_world_;
  int longest_;
  std::size_t cap_, bytes_ = 0;
  std::map<int, Kept> kept_;
  std::list<int> ages_;  // the last used first
};

}  // namespace vsplat
