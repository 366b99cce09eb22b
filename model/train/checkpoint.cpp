#include "model/train/checkpoint.h"

#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <filesystem>
#include <vector>

#include "model/networks/params/model_file.h"
#include "model/networks/params/params.h"
#include "runtime/fail.h"
#include "runtime/files/safetensors.h"
#include "runtime/log.h"
#include "runtime/printable.h"

namespace vsplat {
namespace {

namespace fs = std::filesystem;

constexpr const char* kVersion = "1";
constexpr std::string_view kFirst = "checkpoint-", kLast = ".safetensors", kUnfinished = ".tmp";
constexpr const char* kM = "adamw.m.";
constexpr const char* kV = "adamw.v.";
constexpr const char* kMomentum = "muon.m.";
constexpr const char* kAverage = "average.";
constexpr const char* kState = "state.";

// ----------------------------------------------------------------------------------------------------------------
// one file

void add(std::vector<TensorToWrite>& out, const std::string& path, const std::string& prefix,
         const std::vector<Parameter>& expected, const Weights& weights, bool all) {
  std::size_t found = 0;
  for (const Parameter& parameter : expected) {
    if (!all && !weights.has(parameter.name)) continue;
    const HostTensor& tensor = weights.at(parameter.name);
    if (tensor.shape != parameter.shape || static_cast<long>(tensor.data.size()) != parameter.count())
      fail(Status::internal, "{}: {}{} has shape {}, expected {}", path, prefix, parameter.name, text_of(tensor.shape),
           text_of(parameter.shape));
    out.push_back({prefix + parameter.name, Dtype::f32, tensor.shape, tensor.data.data()});
    ++found;
  }
  if (found != weights.all().size())
    fail(Status::internal, "{}: {} tensors for {}, of which the model has {}", path, weights.all().size(), prefix,
         found);
}

const std::string& metadata_at(const SafetensorsFile& file, const char* key) {
  const auto it = file.metadata().find(key);
  if (it == file.metadata().end())
    fail(Status::format, "{}: its metadata have no {}: not a checkpoint of vsplat", file.path(), key);
  return it->second;
}

void check_format(const SafetensorsFile& file) {
  if (const std::string& format = metadata_at(file, "format"); format != kCheckpointFormat)
    fail(Status::format, "{}: metadata format is \"{}\", expected \"{}\"", file.path(), printable(format),
         kCheckpointFormat);
  if (const std::string& version = metadata_at(file, "version"); version != kVersion)
    fail(Status::format, "{}: metadata version is \"{}\", expected \"{}\": made by another version of vsplat",
         file.path(), printable(version), kVersion);
  metadata_at(file, "sha256");
  if (file.check_hash() != HashState::matches)
    fail(Status::format, "{}: its content does not match its sha256: the file is damaged", file.path());
}

TrainConfig read_config(const SafetensorsFile& file) {
  try {
    return train_config_from_json(metadata_at(file, "config"));
  } catch (const Error& e) {
    fail(e.status(), "{}: {}", file.path(), e.what());
  }
}

bool parse_step(std::string_view text, long& step) {
  const auto [stop, problem] = std::from_chars(text.data(), text.data() + text.size(), step);
  return problem == std::errc() && stop == text.data() + text.size() && step >= 0;
}

// Moments that the file has under the prefix.
Weights read_moments(const SafetensorsFile& file, const std::vector<Parameter>& expected, const std::string& prefix) {
  Weights out;
  for (const Parameter& parameter : expected) {
    const TensorEntry* entry = file.find(prefix + parameter.name);
    if (entry == nullptr) continue;
    if (entry->shape != parameter.shape || entry->dtype != Dtype::f32)
      fail(Status::format, "{}: tensor {} is {} {}, expected F32 {}", file.path(), entry->name, name_of(entry->dtype),
           printable(text_of(entry->shape)), text_of(parameter.shape));
    out.set(parameter.name, {parameter.shape, file.floats(*entry)});
  }
  return out;
}

void check_moments(const std::string& path, const Checkpoint& checkpoint) {
  for (const auto& [some, others, what] :
       {std::tuple(&checkpoint.m, &checkpoint.v, "adamw.v"), std::tuple(&checkpoint.v, &checkpoint.m, "adamw.m")})
    for (const auto& [name, tensor] : some->all())
      if (!others->has(name))
        fail(Status::format, "{}: no tensor {}.{}, although its counterpart is there", path, what, name);
}

// ----------------------------------------------------------------------------------------------------------------
// the folder

struct Found {
  long step = 0;
  std::string path;
};

// The step in a checkpoint's file name; nothing for other files.
std::optional<long> step_of(const std::string& name) {
  if (!name.starts_with(kFirst) || !name.ends_with(kLast)) return std::nullopt;
  if (name.size() < kFirst.size() + kLast.size()) return std::nullopt;
  long step = 0;
  if (!parse_step(std::string_view(name).substr(kFirst.size(), name.size() - kFirst.size() - kLast.size()), step))
    return std::nullopt;
  return step;
}

std::vector<std::string> names_in(const std::string& folder) {
  std::vector<std::string> names;
  std::error_code problem;
  for (auto it = fs::directory_iterator(folder, problem); !problem && it != fs::directory_iterator();
       it.increment(problem))
    names.push_back(it->path().filename().string());
  if (problem) fail(Status::file, "{}: its files cannot be listed: {}", folder, problem.message());
  return names;
}

// Newest first.
std::vector<Found> checkpoints_in(const std::string& folder) {
  std::vector<Found> found;
  for (const std::string& name : names_in(folder))
    if (const std::optional<long> step = step_of(name)) found.push_back({*step, (fs::path(folder) / name).string()});
  std::sort(found.begin(), found.end(),
            [](const Found& a, const Found& b) { return std::tie(b.step, b.path) < std::tie(a.step, a.path); });
  return found;
}

void remove_file(const std::string& path) {
  std::error_code problem;
  fs::remove(path, problem);
  if (problem) warn("{}: cannot be removed: {}", path, problem.message());
}

}  // namespace

std::string checkpoint_path(const std::string& folder, long step) {
  return (fs::path(folder) / fmt::format("{}{:08}{}", kFirst, step, kLast)).string();
}

void save_checkpoint(const std::string& path, const Checkpoint& checkpoint) {
  const std::vector<Parameter> expected = parameters(checkpoint.config.model);
  std::vector<TensorToWrite> tensors;
  add(tensors, path, "", expected, checkpoint.parameters, true);
  add(tensors, path, kM, expected, checkpoint.m, false);
  add(tensors, path, kV, expected, checkpoint.v, false);
  add(tensors, path, kMomentum, expected, checkpoint.momentum, false);
  if (checkpoint.config.ema != 0) add(tensors, path, kAverage, expected, checkpoint.average, true);
  std::map<std::string, std::string> metadata = {{"format", kCheckpointFormat},
                                                 {"version", kVersion},
                                                 {"step", std::to_string(checkpoint.step)},
                                                 {"config", to_json(checkpoint.config)},
                                                 {"config_sha256", hash_of(checkpoint.config)}};
  for (const auto& [name, text] : checkpoint.state) metadata[kState + name] = text;
  write_safetensors(path, tensors, metadata, true);
}

Checkpoint load_checkpoint(const std::string& path) {
  const SafetensorsFile file(path);
  check_format(file);
  Checkpoint out;
  out.config = read_config(file);
  if (!parse_step(metadata_at(file, "step"), out.step))
    fail(Status::format, "{}: metadata step is \"{}\", expected a whole number from 0", path,
         printable(metadata_at(file, "step")));
  const std::vector<Parameter> expected = parameters(out.config.model);
  out.parameters = read_weights(file, out.config.model, "");
  out.m = read_moments(file, expected, kM);
  out.v = read_moments(file, expected, kV);
  out.momentum = read_moments(file, expected, kMomentum);
  if (out.config.ema != 0) out.average = read_weights(file, out.config.model, kAverage);
  check_moments(path, out);
  std::size_t known = 0;
  for (const Weights* some : {&out.parameters, &out.m, &out.v, &out.momentum, &out.average})
    known += some->all().size();
  if (known != file.tensors().size())
    fail(Status::format, "{}: {} tensors, of which this configuration has {}", path, file.tensors().size(), known);
  for (const auto& [key, text] : file.metadata())
    if (key.starts_with(kState)) out.state[key.substr(std::string_view(kState).size())] = text;
  return out;
}

std::optional<Checkpoint> newest_checkpoint(const std::string& folder) {
  const std::vector<Found> found = checkpoints_in(folder);
  for (const Found& candidate : found) {
    try {
      return load_checkpoint(candidate.path);
    } catch (const Error& e) {
      if (e.status() != Status::format && e.status() != Status::file) throw;
      warn("a checkpoint is skipped: {}", e.what());
    }
  }
  if (!found.empty())
    fail(Status::format, "{}: none of its {} checkpoints is whole; to begin again, remove them or train elsewhere",
         folder, found.size());
  return std::nullopt;
}

void prune_checkpoints(const std::string& folder, long keep) {
  const std::vector<Found> found = checkpoints_in(folder);
  for (std::size_t i = static_cast<std::size_t>(keep); i < found.size(); ++i) remove_file(found[i].path);
  for (const std::string& name : names_in(folder))
    if (name.starts_with(kFirst) && name.ends_with(kUnfinished)) remove_file((fs::path(folder) / name).string());
}

void save_model(const std::string& path, const Checkpoint& checkpoint, std::map<std::string, std::string> provenance) {
  provenance["step"] = std::to_string(checkpoint.step);
  provenance["seed"] = std::to_string(checkpoint.config.seed);
  provenance["training"] = to_json(checkpoint.config);
  save_model(path, checkpoint.config.model, checkpoint.config.ema != 0 ? checkpoint.average : checkpoint.parameters,
             provenance);
}

}  // namespace vsplat
