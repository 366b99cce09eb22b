// What the kernel files hold, told by their text: for lists of all kernels, whether something launches them or not.
#pragma once
#include <string>
#include <vector>

namespace vsplat {

struct KernelFile {
  std::string name;                  // "gemm_gpu" of cl/dense/gemm_gpu.cl
  std::vector<std::string> kernels;  // in the order of the text
  // Of a line "// targets: nvptx" (names with commas between): whose compilers alone can read it. Empty: every one's.
  std::vector<std::string> targets;
  bool cpu_alone = false;  // a line "// flavour: cpu": the gpu flavour launches nothing of it
};

// Every cl/<name>.cl that the library carries, or that $VSPLAT_KERNEL_DIR has, by name.
std::vector<KernelFile> kernel_files();

// Whether a flavour may launch a kernel: by the end of its name, else of its file's, _cpu or _gpu; else both, but where
// the file says otherwise.
bool is_of_cpu(const KernelFile& file, const std::string& kernel);
bool is_of_gpu(const KernelFile& file, const std::string& kernel);

// cl/allowed.txt: what kernels may keep in scratch memory on which compilers' targets, and why. Empty where there is
// none.
std::string allowed_scratch();

}  // namespace vsplat
