#include "model/fit/fit_checkpoint.h"

#include <fmt/format.h>

#include <charconv>
#include <cstdlib>
#include <filesystem>

#include "runtime/fail.h"
#include "runtime/files/safetensors.h"
#include "runtime/printable.h"

namespace vsplat {
namespace {

namespace fs = std::filesystem;

constexpr const char* kFormat = "vsplat-refinement";
constexpr const char* kVersion = "1";
constexpr std::string_view kState = "state.";

const std::string& metadata_at(const SafetensorsFile& file, const char* key) {
  const auto found = file.metadata().find(key);
  if (found == file.metadata().end())
    fail(Status::format, "{}: its metadata have no {}: not a fit's state", file.path(), key);
  return found->second;
}

void check_format(const SafetensorsFile& file) {
  for (const auto& [key, expected] : {std::pair("format", kFormat), std::pair("version", kVersion)})
    if (const std::string& found = metadata_at(file, key); found != expected)
      fail(Status::format, "{}: metadata {} is \"{}\", expected \"{}\"", file.path(), key, printable(found), expected);
  metadata_at(file, "sha256");
  if (file.check_hash() != HashState::matches)
    fail(Status::format, "{}: its content does not match its sha256: the file is damaged", file.path());
}

const std::string& state_at(const FitCheckpoint& checkpoint, const std::string& name) {
  const auto found = checkpoint.state.find(name);
  if (found == checkpoint.state.end()) fail(Status::format, "a fit's state has no {}", printable(name));
  return found->second;
}

}  // namespace

std::string fit_checkpoint_path(const std::string& folder) {
  return (fs::path(folder) / "refinement.safetensors").string();
}

void save_fit_checkpoint(const std::string& folder, const FitCheckpoint& checkpoint) {
  std::vector<TensorToWrite> tensors;
  for (const auto& [name, tensor] : checkpoint.tensors)
    tensors.push_back({name, Dtype::f32, tensor.shape, tensor.data.data()});
  std::map<std::string, std::string> metadata = {
      {"format", kFormat}, {"version", kVersion}, {"request", checkpoint.request}};
  for (const auto& [name, text] : checkpoint.state) metadata[std::string(kState) + name] = text;
  write_safetensors(fit_checkpoint_path(folder), tensors, metadata, true);
}

std::optional<FitCheckpoint> load_fit_checkpoint(const std::string& folder, const std::string& request) {
  const std::string path = fit_checkpoint_path(folder);
  std::error_code problem;
  if (!fs::exists(path, problem)) return std::nullopt;
  const SafetensorsFile file(path);
  check_format(file);
  FitCheckpoint out;
  out.request = metadata_at(file, "request");
  if (out.request != request)
    fail(Status::usage,
         "{}: this is the state of another fit: other views, options or another start. Give those that it began with, "
         "or another folder",
         path);
  for (const auto& [key, text] : file.metadata())
    if (key.starts_with(kState)) out.state[key.substr(kState.size())] = text;
  for (const TensorEntry& entry : file.tensors()) out.tensors[entry.name] = {entry.shape, file.floats(entry)};
  return out;
}

long whole_number(const FitCheckpoint& checkpoint, const std::string& name) {
  const std::string& text = state_at(checkpoint, name);
  long out = 0;
  const auto [end, problem] = std::from_chars(text.data(), text.data() + text.size(), out);
  if (problem != std::errc() || end != text.data() + text.size() || out < 0)
    fail(Status::format, "a fit's state has {} \"{}\", a whole number from 0 expected", printable(name),
         printable(text));
  return out;
}

double number(const FitCheckpoint& checkpoint, const std::string& name) {
  const std::string& text = state_at(checkpoint, name);
  char* end = nullptr;
  const double out = std::strtod(text.c_str(), &end);
  if (text.empty() || *end != '\0')
    fail(Status::format, "a fit's state has {} \"{}\", a number expected", printable(name), printable(text));
  return out;
}

std::string exact_text(double value) { return fmt::format("{:.17g}", value); }

const FitTensor& tensor_of(const FitTensors& tensors, const std::string& name) {
  const auto found = tensors.find(name);
  if (found == tensors.end()) fail(Status::format, "a fit's state has no tensor {}", printable(name));
  return found->second;
}

}  // namespace vsplat
