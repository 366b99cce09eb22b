// A fit under way in a file: all that it needs to go on to the same bits. One file a folder, which appears whole or not
// at all, with the SHA-256 of what is in it.
#pragma once
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "runtime/tensor.h"

namespace vsplat {

struct FitTensor {
  Shape shape;
  std::vector<float> data;
};

using FitTensors = std::map<std::string, FitTensor>;

struct FitCheckpoint {
  std::string request;                       // what was asked for, as text that is equal where the request is
  std::map<std::string, std::string> state;  // single values, as text by name
  FitTensors tensors;
};

// "FOLDER/refinement.safetensors"
std::string fit_checkpoint_path(const std::string& folder);

// Makes the folder where it is not there. Error(file) names the path; what was there before stays.
void save_fit_checkpoint(const std::string& folder, const FitCheckpoint& checkpoint);

// Nothing where the folder holds none. Error(format) for a damaged file, Error(usage) where it is of another request.
std::optional<FitCheckpoint> load_fit_checkpoint(const std::string& folder, const std::string& request);

// What `state` holds of a name, or Error(format).
long whole_number(const FitCheckpoint& checkpoint, const std::string& name);
double number(const FitCheckpoint& checkpoint, const std::string& name);
// As number() reads it back to the bit.
std::string exact_text(double value);
// Error(format) where there is none of that name.
const FitTensor& tensor_of(const FitTensors& tensors, const std::string& name);

}  // namespace vsplat
