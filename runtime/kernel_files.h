// Lists the content of the kernel files, by their text: all kernels, launched or not.
#pragma once
#include <string>
#include <vector>

namespace vsplat {

struct KernelFile {
  std::string name;                  // "gemm_gpu" of cl/dense/gemm_gpu.cl
  std::vector<std::string> kernels;  // in the file's order
  // Targets in a line "// targets: nvptx" (names separated by commas): only compilers for these can build the file.
  // Empty: all compilers can.
  std::vector<std::string> targets;
  bool cpu_alone = false;  // a line "// flavour: cpu": the gpu flavour does not use the file
};

// Every cl/<name>.cl that the library carries, or that $VSPLAT_KERNEL_DIR contains, sorted by name.
std::vector<KernelFile> kernel_files();

// Whether a flavour may launch a kernel. A kernel or a file whose name ends in _cpu or _gpu belongs to that flavour;
// the kernel's name takes precedence. All others belong to both, unless the file says otherwise.
bool is_of_cpu(const KernelFile& file, const std::string& kernel);
bool is_of_gpu(const KernelFile& file, const std::string& kernel);

// The content of cl/allowed.txt: which kernels may keep scratch memory with which compilers' targets, and why. Empty
// without that file.
std::string allowed_scratch();

}  // namespace vsplat
