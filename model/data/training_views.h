// What a training step takes from a data set: pictures and cameras of one object, read ahead in the background.
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
  // With TrainingOptions::alpha, for each view [S][S][4]: colour premultiplied by alpha, and alpha; empty where the
  // picture is opaque, or has neither mask nor alpha: it does not say what the object is.
  std::vector<std::vector<std::uint8_t>> rgba = {};
};

struct TrainingOptions {
  int image = 128;                // S, the configuration's
  std::string rebase = "rotate";  // the configuration's
  std::uint64_t seed = 0;
  int batch = 1;                       // items of a step, the objects that it takes
  int first_item = 0, last_item = -1;  // of them those that are asked for, [first, last); -1: all
  int min_inputs = 4, max_inputs = 4;  // input views, by chance between the two
  int novel = 4;
  bool random_background =
      false;           // novel views over white, grey or black, else white; where a picture is opaque, white
  bool alpha = false;  // TrainingViews::rgba is wanted
  Fit fit = Fit::automatic;
  PlacementRequest placement;
  // The object's frame by chance: turned about its middle by at most so much about any axis (after the reference view
  // was made its front, so that it no longer is), and its cube larger by a factor between the two.
  double turn_degrees = 0;
  double min_cube = 1, max_cube = 1;
  // So much of the items are mirrored, and have their colour channels in another order (disguise.h), by chance.
  double mirror = 0, shuffle_channels = 0;
  // So much of the items are in a room (room.h), by chance: one for all their views.
  double rooms = 0;
  // So much of the items, spread evenly, are endless_object()s by the seed and the item's number; the others go through
  // the set as if there were none of these. `textures`: a folder of pictures that they and the rooms' walls may be
  // covered with; "": none.
  double procedural = 0;
  std::string textures = "";
  std::size_t cache_bytes = std::size_t{1} << 30;  // of decoded pictures, S x S x 4 bytes each
  int threads = 2;                                 // that read ahead; 0: all is read when it is asked for
  int ahead = 8;                                   // items read before they are asked for
  bool skip_bad = false;  // views and objects that cannot be read are passed over and counted, else an Error
};

// Which object, views, background, turn, cube and disguise an item has depends on the data, the seed, the step and the
// item alone: not on threads, the cache or what was asked for before. The objects come in random order, each once
// before any comes again, and between them procedural ones; input and novel views are drawn from k-means groups of the
// cameras as draw_views() does.
class TrainingReader {
 public:
  // Error(usage) where an option makes no sense, Error(input) where there is no object and not all are procedural,
  // errors of TextureFolder.
  TrainingReader(DataSet data, TrainingOptions options);
  ~TrainingReader();  // waits for what is being read
  TrainingReader(const TrainingReader&) = delete;
  TrainingReader& operator=(const TrainingReader&) = delete;

  // Item `item` (below `batch`) of step `step` (from 0). Waits until it is read; begins to read those after it. Errors
  // name the object, the view and what is wrong. One thread at a time.
  TrainingViews at(long step, int item);

  // With skip_bad: different views and objects found bad so far, each of which was told once as a warning.
  int bad() const;
  std::size_t cached_bytes() const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace vsplat
