// A stored picture, transformed for display by its orientation.
#pragma once
#include <vector>

#include "model/io/picture/image_formats.h"
#include "runtime/system/host_memory.h"

namespace vsplat {

// Rotates, mirrors or both, for EXIF orientations 2 to 8. Reads all of `stored` and holds it at its stored bit depth.
class OrientedRows : public PixelRows {
 public:
  OrientedRows(const FileBytes& file, FileRows& stored, int orientation);
  void next(float* row) override;

 private:
  float value(const unsigned char* from) const;

  int orientation_, at_ = 0;
  std::size_t bytes_, step_;  // size of a value; distance of rows
  std::vector<unsigned char> values_;
  DecodingMemory held_;
};

}  // namespace vsplat
