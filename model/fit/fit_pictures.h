// The photographs that a scene is fitted to. Each is decoded once and cached while the cache stays below a limit.
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
  // `to_world` maps the frame of the fit to the world. A picture's longer side is at most `longest` pixels (0: the
  // picture's own size). `cap`: bytes of host memory for all cached pictures; the picture that was asked for last is
  // cached even above it. Others stay in their files, and are decoded again. `metric_depths`: whether depths are
  // lengths.
  FitPictures(const Photographs& photographs, const Similarity& to_world, int longest, std::size_t cap,
              bool metric_depths = true);

  // Decodes the picture unless it is cached. Errors as those of LoadedPhotograph; Error(input) if a pixel's value is
  // not a number.
  std::shared_ptr<const FitPicture> at(int view);
  // Starts to decode, in the background, the views that the caller will pass to at() next, in that order: at least the
  // first of them, and no more than the processor has threads and the cache has memory for. Waits for others that it
  // began. at() reports the errors. Does nothing unless the pictures are files: another source may be bound to the
  // caller's thread.
  void read_ahead(const std::vector<int>& views);
  // How many views read_ahead() takes.
  std::size_t most_ahead() const;
  void forget(int view);                        // drops the view from the cache
  void limit(std::size_t cap);                  // another cap from now on
  std::size_t bytes() const { return bytes_; }  // of all cached pictures

  // The camera of the view's picture. Decodes nothing once at() has returned that.
  Camera camera(int view);

  // Cameras of these views' pictures, in the frame of the fit, without the correction of lenses. Reads only the
  // pictures' headers.
  std::vector<Camera> cameras(const std::vector<int>& views) const;
  // The one of them with the largest picture.
  Camera largest(const std::vector<int>& views) const;

 private:
  struct Cached {
    std::shared_ptr<const FitPicture> picture;
    std::list<int>::iterator age;
  };
  std::shared_ptr<const FitPicture> load(int view) const;

  const Photographs& photographs_;
  Similarity to_world_;
  int longest_;
  std::size_t cap_, bytes_ = 0, largest_ = 1;  // largest_: of all pictures that at() has returned, in bytes
  bool metric_depths_;
  std::map<int, Cached> cached_;
  std::list<int> ages_;            // the most recently used first
  std::map<int, Camera> cameras_;  // of all pictures that at() has returned
  std::map<int, std::future<std::shared_ptr<const FitPicture>>> ahead_;
};

}  // namespace vsplat
