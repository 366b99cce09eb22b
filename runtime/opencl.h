// Configures Khronos' C++ bindings in one place. Only runtime's sources include it: the layers above do not see OpenCL.
#pragma once
#define CL_HPP_TARGET_OPENCL_VERSION 120
#define CL_HPP_MINIMUM_OPENCL_VERSION 120
#define CL_HPP_ENABLE_EXCEPTIONS
#define CL_TARGET_OPENCL_VERSION 120
#define CL_USE_DEPRECATED_OPENCL_1_2_APIS
#pragma GCC diagnostic push
#pragma GCC diagnostic ignored "-Wpedantic"
#pragma GCC diagnostic ignored "-Wextra"
#pragma GCC diagnostic ignored "-Wshadow"
#pragma GCC diagnostic ignored "-Wignored-attributes"
#include <CL/opencl.hpp>
#pragma GCC diagnostic pop

#include "runtime/fail.h"

namespace vsplat {

// "CL_OUT_OF_RESOURCES" for -5.
const char* cl_error_name(cl_int code);

// Rethrows an OpenCL error as an Error; `what` names the failed action.
[[noreturn]] inline void fail_cl(const cl::Error& e, const std::string& what) {
  const bool memory = e.err() == CL_MEM_OBJECT_ALLOCATION_FAILURE || e.err() == CL_OUT_OF_HOST_MEMORY;
  fail(memory ? Status::memory : Status::device, "{}: {} failed with {} ({})", what, e.what(), cl_error_name(e.err()),
       e.err());
}

// Waits until the device has done all that was enqueued. Use this in place of cl::CommandQueue::finish(): that of Mesa
// 22's rusticl waits for the newest command only if it was not flushed before. A marker is such a command.
inline void wait_for_all(const cl::CommandQueue& queue) {
  queue.enqueueMarkerWithWaitList();
  queue.finish();
}

}  // namespace vsplat
