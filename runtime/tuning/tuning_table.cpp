// Reads and writes a device's table.
#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>
#include <sstream>

#include "runtime/context.h"
#include "runtime/fail.h"
#include "runtime/files/disk_cache.h"
#include "runtime/files/output_file.h"
#include "runtime/files/private_folder.h"
#include "runtime/log.h"
#include "runtime/option.h"
#include "runtime/printable.h"
#include "runtime/program.h"
#include "runtime/system/environment.h"
#include "runtime/system/system.h"
#include "runtime/tuning/tuning.h"

namespace vsplat {
namespace {

using Json = nlohmann::ordered_json;
namespace fs = std::filesystem;

constexpr const char* kTableFormat = "vsplat-tuning";
constexpr int kTableVersion = 1;
constexpr std::uintmax_t kLargestTable = 64 << 20;
constexpr double kNoNumber = 1e30;  // stands for an error that JSON cannot represent

// Hash of the kernels' sources and of the declarations.
std::string hash_of_kernels() {
  std::vector<std::string> parts;
  for (const std::string& name : kernel_file_names()) {
    if (!name.ends_with(".cl") && !name.ends_with(".clh")) continue;
    parts.push_back(name);
    parts.push_back(kernel_text(name));
  }
  for (const TunedDeclaration& one : tuned_declarations()) {
    parts.push_back(fmt::format("{} {}", name_of(one.flavour), text_of(one, {})));
    for (const TunedValues& values : all_values(one)) parts.push_back(text_of(values));
  }
  return DiskCache::key(parts);
}

std::string folder_of_tables() {
  const DiskCache cache;
  return cache.enabled() ? cache.folder() + "/tuning" : "";
}

Json sizes_of(const TunedDeclaration& of, const TunedShape& shape) {
  Json out = Json::object();
  for (std::size_t i = 0; i < of.sizes.size(); ++i) out[of.sizes[i].name] = shape.sizes[i];
  return out;
}

Json set_of(const TunedValues& values) {
  Json out = Json::object();
  for (std::size_t i = 0; i < values.of->parameters.size(); ++i) out[values.of->parameters[i].name] = values.values[i];
  return out;
}

// Reads one file; its errors name the wrong field.
class Reader {
 public:
  explicit Reader(const std::string& path) : path_(path) {}

  [[noreturn]] void wrong(const std::string& field, const std::string& found, const std::string& expected) const {
    fail(Status::format, "{}: {} is {}, {} expected in a table of {}", path_, field, printable(found), expected,
         Option::tune);
  }

  const Json& at(const Json& in, const std::string& field, const char* name, Json::value_t type) const {
    const auto it = in.find(name);
    const Json none;
    const Json& found = it == in.end() ? none : *it;
    const bool number = type == Json::value_t::number_float && found.is_number();
    if (found.type() != type && !number)
      wrong(field + name, shown(found), std::string("a value of type ") + Json(type).type_name());
    return *it;
  }

  std::string text(const Json& in, const std::string& field, const char* name) const {
    return at(in, field, name, Json::value_t::string).get<std::string>();
  }

  long whole(const Json& in, const std::string& field, const char* name) const {
    const auto it = in.find(name);
    if (it == in.end() || !it->is_number_integer())
      wrong(field + name, it == in.end() ? "not there" : shown(*it), "a whole number");
    return it->get<long>();
  }

  static std::string shown(const Json& value) {
    const std::string text = value.dump(-1, ' ', false, Json::error_handler_t::replace);
    return text.size() > 80 ? text.substr(0, 80) + "..." : text;
  }

 private:
  std::string path_;
};

struct Line {
  TunedShape shape;
  TunedValues values;
};

Line line_of(const Reader& reader, const Json& in, const std::string& field, Flavour flavour) {
  if (!in.is_object()) reader.wrong(field, Reader::shown(in), "an object");
  const std::string name = reader.text(in, field + ".", "op");
  const TunedDeclaration* of = tuned_declaration(name, flavour);
  if (!of) reader.wrong(field + ".op", name, std::string("an operation of the ") + name_of(flavour) + " kernels");
  Line out{{of->op, {}}, {of, {}}};
  const Json& shape = reader.at(in, field + ".", "shape", Json::value_t::object);
  for (std::size_t i = 0; i < of->sizes.size(); ++i)
    out.shape.sizes[i] = reader.whole(shape, field + ".shape.", of->sizes[i].name);
  if (class_of(*of, out.shape) != out.shape) reader.wrong(field + ".shape", Reader::shown(shape), "a class of shapes");
  const Json& set = reader.at(in, field + ".", "set", Json::value_t::object);
  for (std::size_t i = 0; i < of->parameters.size(); ++i) {
    const TunedParameter& p = of->parameters[i];
    out.values.values[i] = reader.whole(set, field + ".set.", p.name);
    if (std::find(p.values.begin(), p.values.end(), out.values.values[i]) == p.values.end())
      reader.wrong(field + ".set." + p.name, std::to_string(out.values.values[i]),
                   fmt::format("one of {}", fmt::join(p.values, ", ")));
  }
  return out;
}

// Others could choose what this process runs: only parameters, but they change the bits of results.
bool ours_alone(const std::string& path) {
  const std::optional<sys::FileFacts> found = sys::facts_of_entry(path);
  return found && found->is_file() && found->ours_alone;
}

std::string text_of(const TuningSubject& of) {
  return fmt::format("{} ({}), driver {}, {} kernels of sources {}", printable(of.device), printable(of.platform),
                     printable(of.driver), of.flavour, of.kernels.substr(0, 12));
}

}  // namespace

TuningSubject tuning_subject(const DeviceInfo& device, Flavour flavour) {
  const std::string lowered = device.lowered.empty() ? "" : ", VSPLAT_LIMITS=" + device.lowered;
  return {device.name + ", " + std::to_string(device.compute_units) + " units" + lowered, device.driver,
          device.platform_name + " " + device.platform_version, name_of(flavour), hash_of_kernels()};
}

std::string tuning_path(const TuningSubject& of) {
  const std::string folder = folder_of_tables();
  if (folder.empty()) return "";
  return folder + "/" + DiskCache::key({of.device, of.driver, of.platform, of.flavour, of.kernels}).substr(0, 32) +
         ".json";
}

std::string stored_tuning_path(const std::string& hash) {
  const std::string folder = folder_of_tables();
  return folder.empty() ? "" : folder + "/table-" + hash + ".json";
}

TuningTable read_tuning(const std::string& path) {
  std::error_code error;
  const auto size = fs::file_size(path, error);
  std::ifstream in(path, std::ios::binary);
  if (error || !in) fail(Status::file, "{}: cannot be read as a table of {}", path, Option::tune);
  if (size > kLargestTable) fail(Status::format, "{}: {} bytes, a table has at most {}", path, size, kLargestTable);
  std::stringstream text;
  text << in.rdbuf();
  const Reader reader(path);
  const Json json = Json::parse(text.str(), nullptr, false);
  if (!json.is_object()) reader.wrong("the file", "no JSON object", "a table of tuned parameters");
  if (const std::string format = reader.text(json, "", "format"); format != kTableFormat)
    reader.wrong("format", format, kTableFormat);
  if (const long version = reader.whole(json, "", "version"); version != kTableVersion)
    reader.wrong("version", std::to_string(version), std::to_string(kTableVersion));
  TuningTable out;
  out.of = {reader.text(json, "", "device"), reader.text(json, "", "driver"), reader.text(json, "", "platform"),
            reader.text(json, "", "flavour"), reader.text(json, "", "kernels")};
  if (out.of.flavour != "cpu" && out.of.flavour != "gpu") reader.wrong("flavour", out.of.flavour, "cpu or gpu");
  const Flavour flavour = out.of.flavour == "cpu" ? Flavour::cpu : Flavour::gpu;
  out.measured = reader.text(json, "", "measured");
  const Json& chosen = reader.at(json, "", "chosen", Json::value_t::array);
  for (std::size_t i = 0; i < chosen.size(); ++i) {
    const Line line = line_of(reader, chosen[i], fmt::format("chosen[{}]", i), flavour);
    out.choice.set(line.shape, line.values);
  }
  const Json& tried = reader.at(json, "", "tried", Json::value_t::array);
  for (std::size_t i = 0; i < tried.size(); ++i) {
    const std::string field = fmt::format("tried[{}]", i);
    const Line line = line_of(reader, tried[i], field, flavour);
    TunedTrial trial;
    trial.shape = line.shape;
    trial.values = line.values;
    trial.verdict = reader.text(tried[i], field + ".", "verdict");
    trial.seconds = reader.at(tried[i], field + ".", "seconds", Json::value_t::number_float).get<double>();
    trial.against = reader.at(tried[i], field + ".", "against", Json::value_t::number_float).get<double>();
    trial.error = reader.at(tried[i], field + ".", "error", Json::value_t::number_float).get<double>();
    if (trial.error >= kNoNumber) trial.error = INFINITY;
    if (tried[i].contains("why")) trial.why = reader.text(tried[i], field + ".", "why");
    out.trials.push_back(std::move(trial));
  }
  if (const std::string hash = reader.text(json, "", "hash"); hash != out.choice.hash())
    reader.wrong("hash", hash.empty() ? "empty" : hash, "that of what is chosen, " + out.choice.hash());
  return out;
}

void write_tuning(const std::string& path, const TuningTable& table) {
  Json json;
  json["format"] = kTableFormat;
  json["version"] = kTableVersion;
  json["device"] = table.of.device;
  json["driver"] = table.of.driver;
  json["platform"] = table.of.platform;
  json["flavour"] = table.of.flavour;
  json["kernels"] = table.of.kernels;
  json["measured"] = table.measured;
  json["hash"] = table.choice.hash();
  json["chosen"] = Json::array();
  for (const auto& [shape, values] : table.choice.chosen())
    json["chosen"].push_back(
        {{"op", values.of->name}, {"shape", sizes_of(*values.of, shape)}, {"set", set_of(values)}});
  json["tried"] = Json::array();
  for (const TunedTrial& t : table.trials) {
    Json one{{"op", t.values.of->name},
             {"shape", sizes_of(*t.values.of, t.shape)},
             {"set", set_of(t.values)},
             {"verdict", t.verdict},
             {"seconds", t.seconds},
             {"against", t.against},
             {"error", std::isfinite(t.error) ? t.error : kNoNumber}};
    if (!t.why.empty()) one["why"] = t.why;
    json["tried"].push_back(std::move(one));
  }
  const std::string folder = fs::path(path).parent_path().string();
  make_private_folder(folder);
  OutputFile out(path, folder == folder_of_tables() ? kOwnersAlone : sys::Whose::everybody);
  out.write(json.dump(1, ' ', false, Json::error_handler_t::replace) + "\n");
  out.commit();
}

namespace {

// The table that VSPLAT_TUNING names.
TuningTable named_tuning(const std::string& path) {
  try {
    return read_tuning(path);
  } catch (const Error& e) {
    fail(e.status(), "{}; unset VSPLAT_TUNING, which names it, or set VSPLAT_TUNING=off", e.what());
  }
}

}  // namespace

std::shared_ptr<const Tuning> tuning_for(const DeviceInfo& device, Flavour flavour) {
  static const auto& none = *new auto(std::make_shared<const Tuning>());
  const std::string asked = environment("VSPLAT_TUNING");
  if (asked == "off") return none;
  if (!asked.empty()) {
    const TuningTable table = named_tuning(asked);
    const TuningSubject here = tuning_subject(device, flavour);
    if (table.of != here)
      fail(Status::usage,
           "{} (VSPLAT_TUNING) is a table for {}; this is {}: unset VSPLAT_TUNING to use each device's own table of "
           "{}, or set VSPLAT_TUNING=off",
           asked, text_of(table.of), text_of(here), Option::tune);
    return std::make_shared<const Tuning>(table.choice);
  }
  // Most devices have no table; then nothing needs to be hashed.
  const std::string folder = folder_of_tables();
  std::error_code error;
  if (folder.empty() || !fs::is_directory(folder, error)) return none;
  const TuningSubject here = tuning_subject(device, flavour);
  const std::string path = tuning_path(here);
  if (!fs::exists(path, error)) return none;
  try {
    if (!ours_alone(path))
      fail(Status::file, "{}: others may write to it, so it is not used: `chmod go-w` it if it is yours", path);
    const TuningTable table = read_tuning(path);
    if (table.of != here) fail(Status::format, "{}: a table for {}", path, text_of(table.of));
    return std::make_shared<const Tuning>(table.choice);
  } catch (const Error& e) {
    warn("no tuned parameters are used: {}; {} makes a new table", e.what(), Option::tune);
    return none;
  }
}

}  // namespace vsplat
