// The photographs that a scene is fitted to, decoded once and kept while they fit under a cap.
#pragma once
#include <cstdint>
#include <future>
#include <list>
#include <map>
#include <memory>
#include <vector>

#include "model/base/scene.h"
#include "model/fit/fit_picture.h"
#include "model/views/photographs.h"

namespace vsplat {

class FitPictures {
 public:
  // In the frame that `to_world` leads out of; a picture's longer side is at most `longest` pixels (0: as it is).
  // `cap`: bytes of host memory that decoded pictures may take together, but for the one that is asked for.
  FitPictures(const Photographs& photographs, const Similarity& to_world, int longest, std::size_t cap);

  // Decodes where it must. Errors as LoadedPhotograph's; Error(input) where a pixel's value is no number.
  std::shared_ptr<const FitPicture> at(int view);
  // Begins to decode a view that at() will be asked for next, beside what the caller does; what fails is at()'s error.
  // Only where pictures are in files: what makes them otherwise may be bound to the caller's thread.
  void read_ahead(int view);
  void forget(int view);  // which is decoded again where it is asked for

  // A camera of the size of the largest of these views' pictures, of which the headers alone are read.
  Camera largest(const std::vector<int>& views) const;

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
  int ahead_view_ = -1;
  std::future<std::shared_ptr<const FitPicture>> ahead_;
};

}  // namespace vsplat
