// Names of jobs: what a list of kernels, or a search for the fastest, is for.
#pragma once
#include <cstdint>
#include <string>

namespace command {

// "reconstruct,train" as a sum of values of vsplat_program_jobs. UsageError naming the option.
uint32_t jobs_of(const std::string& option, const std::string& text);

}  // namespace command
