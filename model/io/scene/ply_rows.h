// Reads the rows of one element of a PLY file, in any of the three encodings, in bounded memory.
#pragma once
#include <cstddef>
#include <cstdint>
#include <memory>
#include <vector>

#include "model/io/scene/ply_file.h"
#include "model/io/scene/ply_header.h"

namespace vsplat {

class PlyRows {
 public:
  // Checks that the file can hold everything that the header promises up to the element's end, before memory is
  // allocated for it: Error(format) otherwise. With `tells_rest`, warns about bytes beyond what the header describes.
  // `file`, `header` and `element` (one of the header's) must outlive the rows; `wanted` are properties of the element.
  static std::unique_ptr<PlyRows> open(PlyFile& file, const PlyHeader& header, const PlyElement& element,
                                       std::vector<const PlyProperty*> wanted, bool tells_rest = true);
  virtual ~PlyRows() = default;

  // The wanted values of the next row; values beyond a float's range become infinite. Call it at most element.count
  // times.
  virtual void next(float* values) = 0;
  // For the row returned by next(): the i-th wanted value as stored, and its byte offset in the file.
  virtual double value(std::size_t i) const = 0;
  virtual std::uint64_t byte_of(std::size_t i) const = 0;
};

}  // namespace vsplat
