// Input of a training step from a data set: pictures and cameras of one object, prefetched in the background.
#pragma once
#include <array>
#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "model/data/framed_object.h"

namespace vsplat {

// `inputs` input views, then the novel ones.
struct TrainingViews {
  std::string object;
  std::vector<float> pictures;  // [n + n'][S][S][3]: inputs on white, novel views over the background
  std::vector<Camera> cameras;  // S x S, in the object's frame; the first view is the reference
  int inputs = 0;
  std::array<float, 3> background{1, 1, 1};  // of the novel views
  // With TrainingOptions::alpha, for each view [S][S][4]: colour premultiplied by alpha, and alpha. Empty if the
  // picture is opaque or has neither mask nor alpha, so that it does not mark the object.
  std::vector<std::vector<std::uint8_t>> rgba = {};
};

struct TrainingOptions {
  int image = 128;                // S, from the configuration
  std::string rebase = "rotate";  // from the configuration
  std::uint64_t seed = 0;
  int batch = 1;                       // items of a step, each with one object
  int first_item = 0, last_item = -1;  // the items requested here, [first, last); -1: all
  int min_inputs = 4, max_inputs = 4;  // number of input views, random between the two
  // The share of items whose input views are the first listed ones of their groups, as the published protocol takes
  // them: see draw_views(). The cameras of a rendered set are listed from above to below.
  double first_listed = 0;
  int novel = 4;
  bool random_background =
      false;           // novel views over white, grey or black, else white; opaque pictures always use white
  bool alpha = false;  // TrainingViews::rgba is wanted
  Crop crop = Crop::automatic;
  PlacementRequest placement;
  // Random change of the object's frame: rotated about its centre by at most this angle about any axis (after the
  // reference view was made its front, which it then no longer is), and with the cube scaled by a factor between the
  // two.
  double turn_degrees = 0;
  double min_cube = 1, max_cube = 1;
  // The shares of items that are mirrored, and whose colour channels are permuted (disguise.h).
  double mirror = 0, shuffle_channels = 0;
  double rooms = 0;  // share of items with an indoor background (`Room`), one for all views of an item
  // The share of items, evenly spread, that are endless_object()s by the seed and the item's number; the other items
  // iterate over the set as without it. `textures`: a folder of pictures for these objects and for the walls of
  // backgrounds; "": none.
  double procedural = 0;
  std::string textures = "";
  std::size_t cache_bytes = std::size_t{1} << 30;  // of decoded pictures, S x S x 4 bytes each
  int threads = 2;                                 // that prefetch; 0: everything is read on request
  int ahead = 8;                                   // items prefetched
  bool skip_bad = false;  // skips and counts views and objects that cannot be read, else an Error
};

// The object, views, background, rotation, cube and augmentation of an item only depend on the data, the seed, the step
// and the item, not on threads, the cache or earlier requests. Objects come in random order, each once before any
// repeats, with procedural ones between them. Input and novel views are drawn from k-means groups of the cameras by
// draw_views().
class TrainingReader {
 public:
  // Error(usage) if an option is invalid, Error(input) if there is no object and not all items are procedural; also the
  // errors of TextureFolder.
  TrainingReader(DataSet data, TrainingOptions options);
  ~TrainingReader();  // waits for reads in progress
  TrainingReader(const TrainingReader&) = delete;
  TrainingReader& operator=(const TrainingReader&) = delete;

  // Item `item` (below `batch`) of step `step` (from 0). Waits until it is read, and starts reading the items after it.
  // Errors name the object, the view and the problem. Not thread-safe.
  TrainingViews at(long step, int item);

  // With skip_bad: the number of distinct bad views and objects so far, each of which was reported once as a warning.
  int bad() const;
  std::size_t cached_bytes() const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace vsplat
