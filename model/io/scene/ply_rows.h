// The rows of one element of a PLY file, from any of the three encodings, in bounded memory.
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
  // Checks that everything the header promises up to the element's end can be in the file, before anything is made for
  // it: Error(format) otherwise. Warns of bytes that nothing in the header accounts for. `file`, `header` and `element`
  // (one of the header's) must outlive the rows; `wanted` are properties of it.
  static std::unique_ptr<PlyRows> open(PlyFile& file, const PlyHeader& header, const PlyElement& element,
                                       std::vector<const PlyProperty*> wanted);
  virtual ~PlyRows() = default;

  // The wanted values of the next row; beyond a float's range they are infinite. To be called element.count times at
  // most.
  virtual void next(float* values) = 0;
  // Of the row that next() gave: the i-th wanted value as the file has it, and the byte of the file where it begins.
  virtual double value(std::size_t i) const = 0;
  virtual std::uint64_t byte_of(std::size_t i) const = 0;
};

}  // namespace vsplat
