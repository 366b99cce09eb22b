// What kernels count that are compiled with -DCOUNT (cl/render/rasterize.clh): 64 bits for each row of a profile, on the
// device.
#pragma once
#include <cstdint>
#include <map>
#include <string>
#include <utility>
#include <vector>

#include "runtime/opencl.h"
#include "runtime/tensor.h"

namespace vsplat {

class Counters {
 public:
  // The numbers, and which of them is that row's: the last two arguments of its kernels. Zeros at first.
  Tensor numbers(const cl::Context& context, const cl::CommandQueue& queue);
  long number_of(const std::string& stage, const std::string& name, double flops_per_count);

  // What each row has counted since it was last asked for. Waits for the device.
  struct Count {
    std::string stage, name;
    std::uint64_t count;
    double flops;
  };
  std::vector<Count> take(const cl::CommandQueue& queue);

 private:
  struct Row {
    double flops_per_count;
    std::uint64_t taken;
  };
  Tensor numbers_;
  bool used_ = false;  // since it was last asked for
  std::map<std::pair<std::string, std::string>, long> places_;
  std::vector<Row> rows_;
};

}  // namespace vsplat
