// A stored picture as its orientation says that it is to be shown.
#pragma once
#include <vector>

#include "model/io/picture/image_formats.h"
#include "runtime/system/host_memory.h"

namespace vsplat {

// Turned, mirrored or both, by EXIF's 2 to 8. Reads all of `stored`, and holds it in as many bits as it is stored in.
class OrientedRows : public PixelRows {
 public:
  OrientedRows(const FileBytes& file, FileRows& stored, int orientation);
  void next(float* row) override;

 private:
  float value(const unsigned char* from) const;

  int orientation_, at_ = 0;
  std::size_t bytes_, step_;  // of a value; from row to row
  std::vector<unsigned char> values_;
  DecodingRoom held_;
};

}  // namespace vsplat
