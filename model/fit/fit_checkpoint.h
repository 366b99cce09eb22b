// The checkpoint of a fit: a file with all that the fit needs to resume bit for bit. Each folder holds one such file.
// It is written atomically and contains a SHA-256 of its content.
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
  std::string request;                       // the request as text; equal requests give equal texts
  std::map<std::string, std::string> state;  // single values as text, by name
  FitTensors tensors;
};

// "FOLDER/refinement.safetensors"
std::string fit_checkpoint_path(const std::string& folder);

// Creates the folder if it does not exist. Error(file) names the path; an earlier checkpoint then stays as it was.
void save_fit_checkpoint(const std::string& folder, const FitCheckpoint& checkpoint);

// Returns nothing if the folder holds no checkpoint. Error(format) if the file is damaged, Error(usage) if it belongs
// to another request.
std::optional<FitCheckpoint> load_fit_checkpoint(const std::string& folder, const std::string& request);

// The value of `name` in `state`; Error(format) if it is missing or is not a number.
long whole_number(const FitCheckpoint& checkpoint, const std::string& name);
double number(const FitCheckpoint& checkpoint, const std::string& name);
// Formats `value` so that number() reads the same bits back.
std::string exact_text(double value);
// Error(format) if there is no tensor of that name.
const FitTensor& tensor_of(const FitTensors& tensors, const std::string& name);

}  // namespace vsplat
