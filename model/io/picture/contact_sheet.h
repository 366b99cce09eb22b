// Many pictures as one: scaled down, side by side in rows.
#pragma once
#include <string>
#include <utility>
#include <vector>

#include "model/base/image.h"
#include "model/base/pixel_rows.h"

namespace vsplat {

struct SheetOptions {
  int cell = 0;      // pixels that a picture's longer side takes at most; 0: 256, less where many are expected
  int columns = 0;   // 0: so many that the sheet is about 4 : 3
  int expected = 0;  // pictures that are going to be added, for the cell's size; 0: unknown
};

// The mean of the pixels (and parts of pixels) that each pixel of the result covers. 1 <= width <= the picture's,
// height likewise.
Image shrunk(const Image& picture, int width, int height);
Image shrunk(PixelRows& picture, int width, int height);

class ContactSheet {
 public:
  static constexpr int margin = 8;       // pixels around and between the cells
  static constexpr int label_room = 12;  // pixels below a picture
  static constexpr float paper = 0.85f;  // their grey

  // Error(usage) where a number is negative or a cell is beyond 4096 pixels.
  explicit ContactSheet(const SheetOptions& options);

  // A picture of three channels; only its cell is kept. Smaller ones are not enlarged. The label stands below it, cut
  // to the cell's width; with one label at least, every cell has room for one.
  void add(const Image& picture, const std::string& label = "");
  int count() const { return static_cast<int>(cells_.size()); }
  // In the order they were added, row by row; each in the middle of a cell as large as the largest. Error(usage) where
  // there is none, Error(input) where the sheet would be larger than a picture file may be.
  Image sheet() const;

 private:
  SheetOptions options_;
  int cell_;
  std::vector<std::pair<Image, std::string>> cells_;  // with their labels
};

}  // namespace vsplat
