// Combines many pictures into one: scaled down and arranged in rows.
#pragma once
#include <string>
#include <utility>
#include <vector>

#include "model/base/image.h"
#include "model/base/pixel_rows.h"

namespace vsplat {

struct SheetOptions {
  int cell = 0;      // limit on a picture's longer side in pixels; 0: 256, or less if many pictures are expected
  int columns = 0;   // 0: chosen for a sheet of about 4 : 3
  int expected = 0;  // number of pictures that will be added, which sets the cell size; 0: unknown
};

// Area average: the mean of the pixels, and fractions of pixels, that each result pixel covers. 1 <= width <= the
// picture's width, and height likewise.
Image shrunk(const Image& picture, int width, int height);
Image shrunk(PixelRows& picture, int width, int height);

class ContactSheet {
 public:
  static constexpr int margin = 8;         // pixels around and between cells
  static constexpr int label_height = 12;  // pixels below a picture for its label
  static constexpr float paper = 0.85f;    // grey of the background

  // Error(usage) if a number is negative or a cell is larger than 4096 pixels.
  explicit ContactSheet(const SheetOptions& options);

  // Adds a picture of three channels and stores only its scaled copy; smaller pictures are not enlarged. The label is
  // drawn below it, cut to the cell's width. If any cell has a label, all cells reserve space for one.
  void add(const Image& picture, const std::string& label = "");
  int count() const { return static_cast<int>(cells_.size()); }
  // The cells in the order of addition, row by row, each centred in a cell as large as the largest. Error(usage) if
  // there is none, Error(input) if the sheet would be larger than a picture file may be.
  Image sheet() const;

 private:
  SheetOptions options_;
  int cell_;
  std::vector<std::pair<Image, std::string>> cells_;  // with labels
};

}  // namespace vsplat
