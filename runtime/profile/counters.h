// Counters of kernels that are compiled with -DCOUNT (cl/render/rasterize.clh): 64 bits on the device for each row of a
// profile.
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
  // The counters, initially zero, and the index of a row's counter: the last two arguments of its kernels.
  Tensor numbers(const cl::Context& context, const cl::CommandQueue& queue);
  long number_of(const std::string& stage, const std::string& name, double flops_per_count);

  // The counts of each row since the last call. Waits for the device.
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
  bool used_ = false;  // since the last take()
  std::map<std::pair<std::string, std::string>, long> places_;
  std::vector<Row> rows_;
};

}  // namespace vsplat
